package com.kuka.roboticsAPI.motionModel;

public abstract class SplineMotionJP<T> {
    double share = 1.0;

    public T setJointVelocityRel(double value) {
        if (!(value > 0.0 && value <= 1.0)) {
            throw new IllegalArgumentException("a share of " + value);
        }
        share = value;
        @SuppressWarnings("unchecked")
        T self = (T) this;
        return self;
    }

    public abstract void print();
}
