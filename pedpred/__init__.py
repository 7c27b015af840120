"""Interaction-aware pedestrian motion prediction in cluttered spaces (Pfeiffer et al. 2018)."""
