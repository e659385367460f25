package com.kuka.roboticsAPI.applicationModel;

public abstract class RoboticsAPIApplication {
    public abstract void run() throws Exception;
}
