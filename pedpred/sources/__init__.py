"""Raw recordings of real places, one module per data set.

A reader takes the folder of one sequence, the name of the scene and its settings (one entry of
`conf/scenes`), and returns a `Scene`. To add a data set: write its module and add its line here.
"""

from pedpred.sources import ewap

SOURCES = {"ewap": ewap.read_sequence}

__all__ = ["SOURCES"]
