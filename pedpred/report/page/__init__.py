"""The page `reports/index.html`: one file with the answer, the plots, the pictures and a replay player."""
