"""Surveys: the same questions asked of many robots, starts, loops and laws; resumable, on one machine or several."""
