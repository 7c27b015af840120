"""A robot that drives among recorded people, with a forecaster in the loop: does it collide less?"""
