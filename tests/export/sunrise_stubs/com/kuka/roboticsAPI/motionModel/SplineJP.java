package com.kuka.roboticsAPI.motionModel;

public class SplineJP {
    public final SplineMotionJP<?>[] segments;

    public SplineJP(SplineMotionJP<?>... segments) {
        this.segments = segments;
    }
}
