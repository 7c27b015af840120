"""Training rows on disk, how they are divided, and how sequences become batches."""

from pedpred.datasets.lanes import LaneBatch, split_sequences, stream_lanes
from pedpred.datasets.rows import TrainingRows, load_rows

__all__ = ["LaneBatch", "TrainingRows", "load_rows", "split_sequences", "stream_lanes"]
