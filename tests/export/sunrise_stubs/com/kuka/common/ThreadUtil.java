package com.kuka.common;

public final class ThreadUtil {
    public static void milliSleep(long milliseconds) {
        System.out.println("sleep " + milliseconds);
    }
}
