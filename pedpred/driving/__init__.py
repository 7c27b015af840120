"""A robot that drives among recorded or simulated people: does a forecaster make it collide less?"""
