"""Small raw recordings and archives, as those who publish data sets write them."""

import io
import tarfile
from collections.abc import Iterable, Mapping
from pathlib import Path

import numpy as np
from PIL import Image

EWAP = {"frame_rate_hz": 10.0, "annotation_frames": 4, "resolution_m": 0.5, "margin_m": 1.0}
EWAP_ROWS = ["4 1 2.0 0 3.0 9 0 9", "4 2 4.0 0 6.0 9 0 9", "8 1 2.5 0 3.0 9 0 9"]

STREET = {"recording": "street", "frame_rate_hz": 25.0, "annotation_frames": 10}
STREET |= {"resolution_m": 0.5, "margin_m": 1.0}
STREET_ROWS = ["0.0\t1.0\t2.0\t3.0", "0.0\t2.0\t-4.0\t6.0", "10.0\t1.0\t2.5\t3.0"]

LABORATORY = {"recording": "hall", "resolution_m": 0.25, "thickness_m": 1.0, "open_end_m": 2.0}
LABORATORY |= {"open_ends": [[[0, 0], [0, 2]]]}
HALL = "# framerate: 16\n# id frame x/m y/m z/m\n1\t0\t0.5\t1\t1.7\n1\t4\t1.0\t1\t1.7\n2\t4\t3.5\t1.5\t1.8\n"
WALLS = """<?xml version="1.0" encoding="UTF-8"?>
<geometry version="0.8" unit="m">
 <rooms><room id="0"><subroom id="0">
  <polygon caption="wall">
   <vertex px="0" py="0"/><vertex px="6" py="0"/><vertex px="6" py="2"/><vertex px="0" py="2"/>
   <vertex px="0" py="0"/>
  </polygon>
  <obstacle id="1"><polygon>
   <vertex px="4" py="0.5"/><vertex px="5" py="0.5"/><vertex px="5" py="1"/><vertex px="4" py="1"/>
  </polygon></obstacle>
 </subroom></room></rooms>
</geometry>
"""


def write_sequence(folder: Path) -> Path:
    """A picture of 8 rows and 10 columns, 1 m per row (x) and 2 m per column (y), wall in row 7."""
    (folder / "obsmat.txt").write_text("\r\n".join(EWAP_ROWS) + "\r\n")
    (folder / "H.txt").write_text(" 1 0 -1\n 0 2 -2\n 0 0 1\n")  # pixel (1, 1) of MATLAB is (0, 0) m
    (folder / "groups.txt").write_text(" 1 2 \n \n")
    blocked = np.zeros((8, 10), dtype=np.uint8)
    blocked[7] = 255
    Image.fromarray(blocked).save(folder / "map.png")
    return folder


def write_street(folder: Path, rows: Iterable[str] = STREET_ROWS) -> Path:
    """Two people of the comparison on ETH/UCY."""
    (folder / "street.txt").write_text("".join(f"{row}\n" for row in rows))
    return folder


def write_laboratory(folder: Path) -> Path:
    """Two people in a hall of 6 m x 2 m with a table, open on the left."""
    (folder / "hall.txt").write_text(HALL)
    (folder / "hall.xml").write_text(WALLS)
    return folder


def write_archive(
    path: Path,
    members: Iterable[tuple[tarfile.TarInfo, bytes]] = (),
    content: Mapping[str, bytes] | None = None,
) -> Path:
    """A .tgz or .tar with the data set below `ewap_dataset/`, preceded by some members of one's own."""
    own = [(tarfile.TarInfo(f"ewap_dataset/{name}"), raw) for name, raw in (content or {}).items()]
    with tarfile.open(path, "w:gz" if path.suffix == ".tgz" else "w") as archive:
        for member, raw in (*members, *own):
            member.size = len(raw)
            archive.addfile(member, io.BytesIO(raw))
    return path
