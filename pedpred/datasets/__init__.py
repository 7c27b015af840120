"""Training rows on disk, how they are divided, and how sequences become batches."""

from pedpred.datasets.lanes import LaneBatch, stream_lanes
from pedpred.datasets.rows import TrainingRows, load_rows
from pedpred.datasets.splits import split_sequences

__all__ = ["LaneBatch", "TrainingRows", "load_rows", "split_sequences", "stream_lanes"]
