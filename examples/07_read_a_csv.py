"""Read a logger's CSV file: say once what its columns mean, in a profile.

`plumbob profile log.csv` drafts a profile for your own file.

It prints::

    300 samples of gyr, acc in ENU
    heading counts from: free
"""

from pathlib import Path

import plumbob

rows = "\n".join(f"{10 * i},0.5,-0.3,0.1,2,-1,1001" for i in range(300))
Path("log.csv").write_text(f"ms,gx,gy,gz,ax,ay,az\n{rows}\n")
Path("logger.toml").write_text("""
separator = ","
frame = "ENU"
header = { names = true }
time = { column = "ms", unit = "ms" }
gyr = { columns = ["gx", "gy", "gz"], unit = "deg/s" }
acc = { columns = ["ax", "ay", "az"], unit = "mg", sign = "specific-force" }
""")

recording = plumbob.read("log.csv", profile="logger.toml")
imu = recording.imu
print(len(imu), "samples of", ", ".join(imu.triads), "in", imu.meta.frame)
track = plumbob.Filter("complementary", frame=imu.meta.frame).process(imu)
plumbob.write("track.parquet", track)
print("heading counts from:", plumbob.read("track.parquet").track.north)
