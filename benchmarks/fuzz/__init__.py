"""Fuzzing: does bad input ever end in a traceback, a hang, half a file, or gigabytes? See `__main__`."""
