package application;

import static com.kuka.roboticsAPI.motionModel.BasicMotions.ptp;

import com.kuka.common.ThreadUtil;
import com.kuka.roboticsAPI.applicationModel.RoboticsAPIApplication;
import com.kuka.roboticsAPI.deviceModel.JointPosition;
import com.kuka.roboticsAPI.deviceModel.LBR;
import com.kuka.roboticsAPI.motionModel.PTP;
import com.kuka.roboticsAPI.motionModel.SplineJP;
import com.kuka.roboticsAPI.motionModel.SplineMotionJP;
import javax.inject.Inject;

${remarks}
public class ${name} extends RoboticsAPIApplication {
    /** A1 to A7 in degrees, and the share of the axes' greatest speed on the way there. */
    private static final double[][] TARGETS = {
${targets}
    };

    @Inject
    private LBR lbr;

    @Override
    public void run() {
${body}
    }

    private SplineJP spline(int first, int last) {
        SplineMotionJP<?>[] segments = new SplineMotionJP<?>[last - first + 1];
        for (int i = first; i <= last; i++) {
            segments[i - first] = target(i);
        }
        return new SplineJP(segments);
    }

    private PTP target(int i) {
        double[] q = new double[7];
        for (int k = 0; k < 7; k++) {
            q[k] = Math.toRadians(TARGETS[i][k]);
        }
        return ptp(new JointPosition(q)).setJointVelocityRel(TARGETS[i][7]);
    }
}
