import com.kuka.roboticsAPI.applicationModel.RoboticsAPIApplication;
import com.kuka.roboticsAPI.deviceModel.LBR;
import java.lang.reflect.Field;
import javax.inject.Inject;

/** Runs an application of a name with an LBR that prints its motions. */
public class Play {
    public static void main(String[] names) throws Exception {
        Object app = Class.forName("application." + names[0]).getDeclaredConstructor().newInstance();
        for (Field field : app.getClass().getDeclaredFields()) {
            if (field.isAnnotationPresent(Inject.class)) {
                field.setAccessible(true);
                field.set(app, new LBR());
            }
        }
        ((RoboticsAPIApplication) app).run();
    }
}
