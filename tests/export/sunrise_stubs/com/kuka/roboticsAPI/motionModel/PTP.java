package com.kuka.roboticsAPI.motionModel;

import com.kuka.roboticsAPI.deviceModel.JointPosition;

public class PTP extends SplineMotionJP<PTP> {
    private final JointPosition target;

    PTP(JointPosition target) {
        this.target = target;
    }

    @Override
    public void print() {
        StringBuilder text = new StringBuilder();
        for (double value : target.values) {
            text.append(value).append(' ');
        }
        System.out.println(text.append(share));
    }
}
