package com.kuka.roboticsAPI.deviceModel;

import com.kuka.roboticsAPI.motionModel.PTP;
import com.kuka.roboticsAPI.motionModel.SplineJP;
import com.kuka.roboticsAPI.motionModel.SplineMotionJP;

/** Prints its motions: a line a target, of seven joints [rad] and the share of their speed, "end" where it stops. */
public class LBR {
    public void move(PTP motion) {
        motion.print();
        System.out.println("end");
    }

    public void move(SplineJP spline) {
        for (SplineMotionJP<?> motion : spline.segments) {
            motion.print();
        }
        System.out.println("end");
    }
}
