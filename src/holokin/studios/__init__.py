"""The studio: a page in the browser with the robot, a loop to drag, and control laws side by side. Extra `studio`."""
