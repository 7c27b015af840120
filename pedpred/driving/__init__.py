"""A robot that drives among recorded or simulated people, with a forecaster in the loop: does it collide less?"""
