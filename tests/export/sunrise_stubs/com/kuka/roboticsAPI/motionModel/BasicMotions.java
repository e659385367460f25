package com.kuka.roboticsAPI.motionModel;

import com.kuka.roboticsAPI.deviceModel.JointPosition;

public final class BasicMotions {
    public static PTP ptp(JointPosition target) {
        return new PTP(target);
    }
}
