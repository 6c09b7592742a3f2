"""Loggers' files that are read without an editor: what they say themselves is taken, and the rest is answered or asked.

The samples are made up in SI; each file is what a kind of logger would make of them, and must give them back.
"""

import json
import tomllib
from functools import reduce
from operator import xor
from pathlib import Path

import numpy as np
import pytest

import plumbob
from plumbob import rotations as rot
from plumbob.core.constants import G0
from plumbob.core.errors import ClockError, DecodeError, ParameterError
from plumbob.files.column_names import taken_apart
from plumbob.files.draft import answer
from plumbob.files.sniff import read_sample
from tests.helpers.io_samples import refused

RATE = 100.0
N = np.arange(600)
T = N / RATE
Q = rot.quat_from_euler_zyx(np.stack([0.5 * np.sin(0.7 * T), 0.3 + 0.2 * np.sin(0.9 * T), 0.4 * np.sin(0.5 * T)], 1))
GYR = np.vstack([rot.rotvec_from_quat(rot.quat_multiply(rot.quat_conjugate(Q[:-1]), Q[1:])) * RATE, np.zeros((1, 3))])
ACC = rot.quat_rotate(rot.quat_conjugate(Q), [0.0, 0.0, G0])
MAG = rot.quat_rotate(rot.quat_conjugate(Q), [0.0, 20.0, -43.0])
DPS, G = np.degrees(GYR), ACC / G0
UP = {"acc.sign": "specific-force"}


def rows(*columns, separator=",", form="{:.6f}"):
    cells = [[v if isinstance(v, str) else form.format(v) for v in column] for column in columns]
    return "".join(separator.join(row) + "\n" for row in zip(*cells, strict=True))


def names(*sensors, axes="XYZ"):
    return ",".join(sensor.replace("*", axis) for sensor in sensors for axis in axes)


SIX = (*DPS.T, *G.T)
GYROFLOW = (
    "GYROFLOW IMU LOG\nversion,1.3\norientation,XYZ\ntscale,0.001\ngscale,0.001\nascale,0.0005\nt,gx,gy,gz,ax,ay,az\n"
)
DOT = "sep=,\nDeviceTag:,D1\nOutputRate:,100Hz\n\nPacketCounter,SampleTimeFine," + (
    names("Quat_*", axes="WXYZ") + "," + names("Acc_*", "Gyr_*") + "\n"
)
ROS = ("%time,field.header.seq,field.header.stamp,field.header.frame_id,"
       + names("field.orientation.*", axes="xyzw") + ",field.orientation_covariance0,"
       + names("field.angular_velocity.*", "field.linear_acceleration.*", axes="xyz") + "\n")  # fmt: skip
STAMPS = [f"{1_700_000_000_000_000_000 + 10_000_000 * k}" for k in range(T.size)]
CLOCK = [f"10:15:{12 + k // 100:02}.{k % 100 * 10:03}" for k in range(T.size)]
TURNS = rows(1e3 * T, *GYR.T).splitlines(True)
WRAPPED = [f"{(4_292_000_000 + 10_000 * k) % 2**32}" for k in range(T.size)]
LOGS = {  # name of the file, its text, what a user answers
    "rows of names and of units, with blanks": (
        "a.csv", "Test:,walk,,,\nTime," + names("Foot/Acceleration/*", "Foot/Angular Velocity/*") + ",Foot/Pressure\n"
        "s,m/s$^2$,m/s$^2$,m/s$^2$,rad/s,rad/s,rad/s,kPa\n" + rows(T, *ACC.T, *GYR.T, np.full(T.size, 100.5)), UP),
    "units in brackets alone": (
        "a.csv", "epoch (ms),elapsed (s)," + names("*-axis (deg/s)", "*-axis (g)", axes="xyz") + "\n"
        + rows([s[:-6] for s in STAMPS], T, *SIX), {}),
    "a comment that is the row of names": (
        "a.csv", ROS + rows(STAMPS, map(str, range(T.size)), STAMPS, ["imu"] * T.size, *Q[:, [1, 2, 3, 0]].T, 0 * T,
                            *GYR.T, *ACC.T), {}),
    "scales in the preamble": (
        "clip.gcsv", GYROFLOW + rows(T * 1e3, *(GYR * 1e3).T, *(G * 2e3).T, form="{:.3f}"), UP),
    "a counter of time that wraps, and an attitude beside": (
        "D1.csv", DOT + rows(map(str, range(T.size)), WRAPPED, *Q.T, *ACC.T, *DPS.T), {}),
    "axes as numbers, counts": (
        "a.csv", "loopIteration, time (GPS us), axisP[0], axisP[1], axisP[2], gyroADC[0] (deg/s), gyroADC[1] (deg/s), "
        "gyroADC[2] (deg/s), accSmooth[0], accSmooth[1], accSmooth[2]\n"
        + rows(map(str, range(T.size)), T * 1e6, 0 * T, 0 * T, 0 * T, *DPS.T, *(G * 4096).T, separator=", "),
        UP | {"acc.unit": "g", "acc.counts_per_unit": 4096}),
    "rates of flight mechanics": (
        "a.csv", "/time,p,q,r,ax,ay,az,temp\n" + rows(T, *GYR.T, *ACC.T, 0 * T - 2950), UP | {"gyr.unit": "rad/s"}),
    "labels in every cell": (
        "a.txt", "".join(f"ax:{a[0]:.6f}\tay:{a[1]:.6f}\taz:{a[2]:.6f}\tgx:{w[0]:.6f}\tgy:{w[1]:.6f}\tgz:{w[2]:.6f}\n"
                         for a, w in zip(G, DPS, strict=True)),
        UP | {"time.rate": "100 Hz", "gyr.unit": "deg/s"}),
    "JSON lines": (
        "a.jsonl", "".join(json.dumps({"id": "mpu1", "acc": dict(zip("xyz", a, strict=True)), "w": w, "ms": t}) + "\n"
                           for t, a, w in zip((1e3 * T).tolist(), ACC.tolist(), GYR.tolist(), strict=True)),
        UP | {"gyr.unit": "rad/s"}),
    "sentences of kinds that name their fields": (
        "a.csv", "$FLYS,1\n$COL,IMU,time,wx,wy,wz,ax,ay,az\n$UNIT,IMU,s,deg/s,deg/s,deg/s,g,g,g\n$DATA\n"
        + "".join(f"$IMU,{row}\n$BARO,{row[:6]},1.5\n" for row in rows(T, *SIX).splitlines()), UP),
    "sentences without names, and others between them": ("a.txt", "".join(
        f"$PIMU,{row}\n" + "$GPGGA,1230,5007.0,N,654.0,E,1,8,0.9,120.1,M,47,M,,\n" * (k % 9 == 0)
        for k, row in enumerate(rows(T, *GYR.T, *ACC.T).splitlines())), UP | {"gyr.unit": "rad/s"}),
    "sensors in a row above their axes, bars": (
        "a.csv", "t_ms|Acc|||Gyro||\n|X|Y|Z|X|Y|Z\n" + rows(1e3 * T, *ACC.T, *GYR.T, separator="|"),
        UP | {"gyr.unit": "rad/s"}),
    "twelve hours and a date of two readings": (
        "a.csv", "When,AccX[mG],Y,Z,GyroX(d/s),Y,Z\n"
        + rows([f"5/8/2024 {t.replace('10:', '11:')} PM" for t in CLOCK], *(1e3 * G).T, *DPS.T), UP),
    "acceleration called linear, and a clock in two columns": (
        "a.csv", "Time,stamp.secs,stamp.nsecs," + names("angular_velocity.*", "linear_acceleration.*", axes="xyz")
        + "\n" + rows(T + 1e6, T // 1, T % 1 * 1e9, *GYR.T, *ACC.T), UP | {"gyr.unit": "rad/s"}),
    "a clock that began long ago": (
        "a.csv", "sensor timestamp [ns]," + names("acc*_", "gyr*_") + "\n"
        + rows([f"599628{s[6:]}" for s in STAMPS], *ACC.T, *GYR.T), UP | {"gyr.unit": "rad/s"}),
    "a time with a colon, bars, labels, and a field of a part": (
        "a.txt", "".join(f"{1e3 * t:.0f}: |Acc X:{a[0]:.5f}, Acc Y:{a[1]:.5f}, Acc Z:{a[2]:.5f} |Gyr X:{w[0]:.6f}, "
                         f"Gyr Y:{w[1]:.6f}, Gyr Z:{w[2]:.6f} |q0:1.00\n" for t, a, w in zip(T, ACC, GYR, strict=True)),
        UP | {"gyr.unit": "rad/s", "time.unit": "ms"}),
    "a serial monitor's arrow": (
        "a.txt", "".join(f"{t} -> {row}" for t, row in zip(CLOCK, rows(*G.T, *DPS.T).splitlines(True), strict=True)),
        UP | {"gyr.unit": "deg/s"}),
    "seconds, and the rest in another column": (
        "a.csv", "min,s,usec," + names("acc*", "gyr*") + "\n" + rows(*([f"{k}" for k in each] for each in (
            7 + (N > 99), (59 + N // 100) % 60, N % 100 * 10_000)), *ACC.T, *GYR.T), UP | {"gyr.unit": "rad/s"}),
    "arrays of JSON, with names and an interval beside": ("a.json", json.dumps({"payload": {"interval_ms": 10,
        "sensors": [{"name": s + n, "units": u} for s, u in (("acc", "m/s2"), ("gyr", "deg/s")) for n in "XYZ"],
        "values": np.hstack([ACC, DPS]).tolist()}}), UP),
    "an array of objects, right and down": ("a.json", json.dumps([{"t_ms": round(1e3 * t), "acc": dict(zip(
        ("fwd", "right", "down"), a, strict=True)), "gyro": dict(zip(("fwd", "right", "down"), w, strict=True))}
        for t, a, w in zip(T.tolist(), ACC.tolist(), GYR.tolist(), strict=True)]), UP | {"gyr.unit": "rad/s"}),
    "minutes and seconds, a cell of words": (
        "a.txt", "time\tname\t" + names("Acc*(g)", "As*(°/s)").replace(",", "\t") + "\n"
        + rows([t[3:] for t in CLOCK], ["WT(6a:2f)"] * T.size, *G.T, *DPS.T, separator="\t"), UP),
    "digits in groups, counts with a scale": (
        "a.csv", "# 16384 LSB/g, 131 LSB/(deg/s)\ntime_us," + names("a*", "g*") + "\n" + rows(
        *([f'"{v:,.0f}"' for v in c] for c in (T * 1e6, *(G * 16384).T, *(DPS * 131).T))), UP),
    "start and rate above bare columns, a semicolon behind": (
        "a.csv", "1714566605.25\n100.0\n" + rows(*ACC.T, *GYR.T).replace("\n", ";\n"), UP | {"gyr.unit": "rad/s"}),
    "vectors in one cell, in quotes and without": (
        "a.csv", "t;acc;label;gyro\n" + "".join('{:.6f};"[{:.6f}, {:.6f}, {:.6f}]";"a;b";{:.6f} {:.6f}  {:.6f}\r\n'
                     .format(t, *a, *w) for t, a, w in zip(T, ACC, GYR, strict=True)), UP | {"gyr.unit": "rad/s"}),
    "a unit in each cell": (
        "a.csv", "t,battery," + names("a*", "g*") + "\n" + "".join("{:.0f} ms,88 %,{:.6f} g,{:.6f}g,{:.6f} g,{:.6f}°/s,"
                 "{:.6f}°/s,{:.6f}°/s\n".format(1e3 * t, *a, *w) for t, a, w in zip(T, G, DPS, strict=True))[:-1], UP),
    "a table for each sensor": (
        "a.txt", "# unit 1\n\n[ACC]\ntime_ms,x,y,z\n" + rows(1e3 * T, *ACC.T) + "\n[GYRO]\ntime_ms,x,y,z,temp\n"
        + rows(1e3 * T, *GYR.T, 20.0 + T)[:-1], UP | {"gyr.unit": "rad/s", "temperature.unit": "degC"}),
    "messages as they are printed": ("a.txt", "WARNING: not yet\n" + "---\n".join(
        f"header: \n  stamp: \n    secs: 170{k // 100}\n    nsecs: {k % 100 * 10_000_000}\n  frame_id: imu\n" + "".join(
            f"{name}: \n  x: {v[0]:.6f}\n  y: {v[1]:.6f}\n  z: {v[2]:.6f}\n{name}_covariance:\n- 0.1\n- 0.2\n"
            for name, v in (("angular_velocity", GYR[k]), ("linear_acceleration", ACC[k]))) for k in range(T.size)),
        {}),
    "units in words above, clocks with a decimal comma": (
        "a.csv", "Units: acc [g], gyro [deg/s], range 16 g\nt;" + names("a*", "g*").replace(",", ";") + "\n"
        + rows(1e3 * T, *G.T, *DPS.T, separator=";", form="{:.5f}").replace(".", ","), UP),
    "a line protocol": ("a.txt", "".join(
        "imu,unit=a7 ax={:.6f},ay={:.6f},az={:.6f},gx={:.6f},gy={:.6f},gz={:.6f},n={}i {}\n".format(*a, *w, k, stamp)
        for k, (a, w, stamp) in enumerate(zip(ACC, GYR, STAMPS, strict=True))), UP | {"gyr.unit": "rad/s"}),
    "tuples below a banner": ("a.txt", "MPY: soft reboot\nMicroPython v1.22\n" + "".join(
        "(({:.6f}, {:.6f}, {:.6f}), ({:.6f}, {:.6f}, {:.6f}))\n".format(*a, *w) for a, w in zip(ACC, GYR, strict=True)),
        UP | {"gyr.unit": "rad/s", "time.rate": "100 Hz"}),
    "the newest row first, feet": ("a.csv", "time_ms," + names("a* (ft/s²)", "g* (dps)") + "\n" + rows(
        1e3 * T[::-1], *(ACC / 0.3048).T[:, ::-1], *DPS.T[:, ::-1]), UP),
    "days of a spreadsheet": ("a.csv", "Date," + names("a* (g)", "g* (dps)") + "\n" + rows(
        45413.5 + T / 86_400, *SIX[3:], *SIX[:3], form="{:.12f}"), UP),
    "types of Android's sensors": ("a.txt", "".join(f"{k}0000000 {kind} " + "{:.6f} {:.6f} {:.6f}\n".format(*v)
        for k, both in enumerate(zip(ACC, GYR, strict=True), 1) for kind, v in zip((1, 4), both, strict=True)), UP),
    "gravity beside": ("a.csv", "t," + names("userAcceleration.*", "gravity.*", "rotationRate.*", axes="xyz") + "\n"
        + rows(T, *(0.1 * G).T, *(-1.1 * G).T, *GYR.T), {"gyr.unit": "rad/s"}),
    "gravity beside an acceleration that lacks it": ("a.csv", "time,seconds_elapsed," + names(
        "rotationRate*", "gravity*", "acceleration*") + "\n" + rows(STAMPS, T, *GYR.T, *(-1.1 * G).T, *(0.1 * G).T),
        {"gyr.unit": "rad/s", "acc.sign": "gravity"}),
    "axes alone": ("a.csv", "Time,X,Y,Z,X,Y,Z\n" + rows(T, *SIX), UP | {"gyr.unit": "deg/s"}),
    "names in the forms in which they are printed": (
        "a.txt", ' # Data format: "%int(ChipTimeUS),' + names("%float(RawGyro*)", "%float(RawAccel*)") + '"\n'
        + rows(1e6 * T, *GYR.T, *G.T), UP | {"gyr.unit": "rad/s"}),
    "a hyphen between date and clock": ("a.csv", "When," + names("a* (g)", "g* (dps)") + "\n" + rows(
        [f"2024-05-01-{clock}" for clock in CLOCK], *SIX[3:], *SIX[:3]), UP),
    "digits of a clock": ("a.csv", "UTC," + names('"a (*, g)"', '"g (*, dps)"') + "\n" + rows(
        [clock.replace(":", "") for clock in CLOCK], *SIX[3:], *SIX[:3]), UP),
    "a line cut at the end, and some that are broken": (
        "a.csv", "time_ms," + names("g*_dps", "a*_g", axes="xyz") + "\n" + rows(T * 1e3, *SIX), UP),
    "names three rows above, a label before them": (
        "a.txt", "Interval=\t0.01 s\nTitle=\t" + names("Acc *", "Gyro *").replace(",", "\t") + "\nRange=" + 6 * "\t10 V"
        + "\nUnit=" + 3 * "\tg" + 3 * "\tdeg/s" + "\n" + rows(T, *G.T, *DPS.T, separator="\t"), UP),
    "a column without a name before the others": (
        "a.csv", names("a* (g)", "g* (dps)") + "\n" + rows(T, *G.T, *DPS.T), UP | {"time.unit": "s"}),
    "names in a line of JSON": (
        "a.csv", "# " + json.dumps({"imu": {"fs": 100, "columns": ["t [s]", *names("a* [g]", "g* [dps]").split(",")]}})
        + "\n" + rows(T, *G.T, *DPS.T), UP),
    "a number in each row, one axis after the other, each under a head of its own": (
        "a.csv", "".join(
            "#default;_result\n#unit;s\nnr;time;sensor;axis;unit;value\n" + "".join(
                f"{k};{t:.2f};{sensor};{axis};{unit};{v:.6f}\n" for k, (t, v) in enumerate(zip(T, values, strict=True)))
            for sensor, unit, vectors in (("acc", "g", G), ("gyro", "°/s", DPS))
            for axis, values in zip("xyz", vectors.T, strict=True)), UP),
    "a number in each row, in turns": (
        "a.csv", "ts,topic,payload\n" + "".join(f"{s},home/{name},{v:.6f}\n" for s, values in zip(
            STAMPS, np.hstack([ACC, GYR]), strict=True) for name, v in zip(
            names("acc/*", "gyro/*").split(","), values, strict=True)), UP | {"gyr.unit": "rad/s"}),
    "the line protocol of a data base, whole numbers": (
        "a.txt", "".join(
            "imu,host=pi ax={:.0f}i,ay={:.0f}i,az={:.0f}i,gx={:.0f}i,gy={:.0f}i,gz={:.0f}i {}\n".format(*v, s)
            for s, v in zip(STAMPS, np.hstack([G * 16384, DPS * 1310]), strict=True)),
        UP | {"acc.unit": "g", "acc.counts_per_unit": 16384, "gyr.unit": "deg/s", "gyr.counts_per_unit": 1310}),
    "the level and the ms of a log, in colour": (
        "a.txt", "".join(
            "\x1b[0;32mI ({:.0f}) imu: ax={:.6f} ay={:.6f} az={:.6f} g, gx={:.6f} gy={:.6f} gz={:.6f} dps\x1b[0m\n"
            .format(1e3 * t + 345, *a, *w) for t, a, w in zip(T, G, DPS, strict=True)), UP),
    "a prompt before each row": (
        "a.txt", "imu> stream\nms," + names("a*", "g*") + "\n" + "".join(
            f"imu> {row}" for row in rows(1e3 * T, *ACC.T, *GYR.T).splitlines(True)), UP | {"gyr.unit": "rad/s"}),
    "a row of names that lacks the first": (
        "a.txt", "# timestamp ang_vel_x ang_vel_y ang_vel_z lin_acc_x lin_acc_y lin_acc_z\n" + rows(
            map(str, range(T.size)), T + 1e6, *GYR.T, *ACC.T, separator=" "), UP | {"gyr.unit": "rad/s"}),
    "a message in a line, without names": (
        "a.csv", rows([f"{k // 100}" for k in range(T.size)], [f"{k % 100 * 10_000_000}" for k in range(T.size)],
                      ["imu"] * T.size, *Q[:, [1, 2, 3, 0]].T, *[0 * T] * 9, *GYR.T, *[0 * T] * 9, *ACC.T, *[0 * T] * 9,
                      form="{:.9f}"), UP | {"gyr.unit": "rad/s"}),
    "messages with braces": ("a.txt", "".join(
        f"header {{\n  stamp {{\n    sec: {k // 100}\n    nsec: {k % 100 * 10_000_000}\n  }}\n}}\n" + "".join(
            "{} {{\n  x: {:.6f}\n  y: {:.6f}\n  z: {:.6f}\n}}\n".format(name, *v[k])
            for name, v in (("angular_velocity", GYR), ("linear_acceleration", ACC))) for k in range(T.size)),
        UP | {"gyr.unit": "rad/s"}),
    "messages that say how old they are": ("a.txt", "".join(
        "\nTOPIC: imu\n    timestamp: {:.0f} (0.01 seconds ago)\n    gyro_rad: [{:.6f}, {:.6f}, {:.6f}]\n"
        "    accelerometer_m_s2: [{:.6f}, {:.6f}, {:.6f}]\n".format(1e6 * t, *w, *a)
        for t, a, w in zip(T, ACC, GYR, strict=True)), UP | {"gyr.unit": "rad/s"}),
    "arrays of objects that lie deep, with one name": ("a.json", json.dumps({"1": {"streams": {key: {"samples": [
        {"value": v.tolist(), "ms": 1e3 * t} for t, v in zip(T.tolist(), values, strict=True)]}
        for key, values in (("ACCL", ACC), ("GYRO", GYR))}}}), UP | {"gyr.unit": "rad/s"}),
    "tables side by side, with rates of their own": (
        "a.csv", "X[s],EMG,X[s]," + names("Acc.* [g]", "Gyro.*") + "\n" + "".join(
            f"{k / 200:.3f},0.1,{row}\n" for k, row in enumerate(rows(T, *G.T, *DPS.T).splitlines() + [6 * ","] * 600)),
        UP | {"gyr.unit": "deg/s"}),
    "rows of parts of the body in turns": ("a.txt", f"2\t{T.size}\n" + "".join(
        f"{k}\n" + "".join(f"{part}\t" + "\t".join(f"{v:.6f}" for v in (*Q[k], *ACC[k], *(i * GYR[k]))) + "\n"
                           for i, part in enumerate(("Head", "Hip"))) for k in range(T.size)),
        UP | {"header.where": [1, "Hip"], "time.rate": "100 Hz", "gyr.unit": "rad/s"}),
    "lines of two instances": ("a.txt", "".join(
        "{}: IMU {{TimeUS : {:.0f}, I : {}, GyrX : {}, GyrY : {}, GyrZ : {}, AccX : {}, AccY : {}, AccZ : {}}}\n"
        .format(c, 1e6 * t, i, *w * i, *a) for c, t, a, w in zip(CLOCK, T, ACC, GYR, strict=True) for i in (0, 1)),
        UP | {"header.where": [3, "1"], "gyr.unit": "rad/s"}),
    "units that few loggers write": (
        "a.txt", "t\tCh1 ax\tCh2 ay\tCh3 az\tCh4 wx\tCh5 wy\tCh6 wz\n[min]" + 3 * "\t[mm/s2]" + 3 * "\t[rev/s]" + "\n"
        + rows(T / 60, *(1e3 * ACC).T, *(DPS / 360).T, separator="\t", form="{:.9f}"), UP),
    "Julian days": ("a.csv", "Julian Date," + names("a* (Gal)", "g* (deg/min)") + "\n" + rows(
        [f"2460432.{round(t / 86_400 * 1e15):015}" for t in T], *(100 * ACC).T, *(60 * DPS).T, form="{:.12f}"), UP),
    "groups of digits in one column alone": ("a.csv", "Milliseconds;" + names("Acc * (mg)", "Gyr * (mdps)").replace(
        ",", ";") + "\n" + "".join("{:.0f};{:,.3f};{:,.3f};{:,.3f};{:,.2f};{:,.2f};{:,.2f}\n".format(
            1e3 * t, *(1e3 * a), *(1e3 * w)) for t, a, w in zip(T, G, DPS, strict=True)), UP),
    "kinds of rows whose names stand above them": (
        "a.txt", "# Raw,utcTimeMillis,TimeNanos\n# UncalAccel,utcTimeMillis," + names("UncalAccel*Mps2")
        + "\n# UncalGyro,utcTimeMillis," + names("UncalGyro*RadPerSec") + "\n" + "".join(
            f"UncalAccel,{a}UncalGyro,{w}" for a, w in zip(rows(1e3 * T, *ACC.T).splitlines(True), TURNS, strict=True)),
        UP),
    "rows that number their sensors": ("a.csv", "".join(f"0,{a}3,{w}" for a, w in zip(
        rows(1e3 * T, *ACC.T).splitlines(True), TURNS, strict=True)),
        UP | {"rows.0": "acc", "rows.3": "gyr", "gyr.unit": "rad/s"}),
    "a list in YAML": ("a.txt", "".join(f"- min: {t / 60:.9f}\n  acc: [{a}]\n  gyr: [{w}]\n" for t, a, w in zip(
        T, rows(*ACC.T).splitlines(), rows(*GYR.T).splitlines(), strict=True)), UP | {"gyr.unit": "rad/s"}),
    "attributes in XML": ("a.txt", "".join(
        '<sample t="{:.2f}" ax="{:.6f}" ay="{:.6f}" az="{:.6f}" gx="{:.6f}" gy="{:.6f}" gz="{:.6f}"/>\n'.format(*row)
        for row in zip(T, *ACC.T, *GYR.T, strict=True)), UP | {"gyr.unit": "rad/s"}),
    "blanks of which each separates": (
        "a.txt", "// DeviceId: 1\n// Coordinate system: ENU\nPacketCounter SampleTimeFine Year "
        + names("Acc_*", "Gyr_*").replace(",", " ") + "\n"
        + "".join(f"{k}   {row}" for k, row in enumerate(rows(*ACC.T, *GYR.T, separator=" ").splitlines(True))),
        {"time.rate": "100 Hz"}),
}  # fmt: skip
for name, form in tomllib.loads(Path(__file__).with_name("prints.toml").read_text(encoding="utf-8")).items():
    lines = (form["line"].format(a=a, g=g, k=1e3 * g, w=w, d=d, t=1e3 * t, c=c.replace(".", ","), even="88" * (n % 2))
             for n, (a, g, w, d, t, c) in enumerate(zip(ACC, G, GYR, DPS, T, CLOCK, strict=True)))  # fmt: skip
    given = UP | form.get("answers", {}) | ({"time.rate": "100 Hz"} if form.get("rate", True) else {})
    LOGS[name] = "a.txt", form.get("head", "") + "".join(lines), given


def drafted(folder, name, text, answers):
    path = folder / name
    path.write_text(text, encoding="utf-8")
    out = folder / f"drafted {name}.toml"
    draft = plumbob.profile(path, accept=True, answers={"frame": "ENU", **answers}, out=out)
    assert draft.questions == ()
    return plumbob.read(path, profile=out)


@pytest.mark.parametrize(
    ("form", "columns", "answered"),
    [
        ("ypr\t{y:.2f}\t{p:.2f}\t{r:.2f}", [2, 3, 4], None),  # as Jeff Rowberg's MPU6050_DMP6 prints
        ("RPY: {r:.2f}, {p:.2f}, {y:.2f}", [3, 2, 1], None),
        ("att,{n},{r:.2f},{p:.2f},{y:.2f}", [], [5, 4, 3]),  # in an order that nothing says
        ("Orientation: {y:.2f}, {p:.2f}, {r:.2f}", [], [1, 2, 3]),
        ("quat\t{q[0]:.2f}\t{q[1]:.2f}\t{q[2]:.2f}\t{q[3]:.2f}", [2, 3, 4, 5], None),
        ("Q,{n}0,{q[0]:.4f},{q[1]:.4f},{q[2]:.4f},{q[3]:.4f}", [3, 4, 5, 6], None),
        ("i: {q[1]:.4f} j: {q[2]:.4f} k: {q[3]:.4f} real: {q[0]:.4f}", [4, 1, 2, 3], None),  # as SH-2 has it
    ],
)
def test_attitude_behind_a_word_is_no_sensor(tmp_path, form, columns, answered):
    path, angles = tmp_path / "a.txt", np.degrees(rot.euler_zyx_from_quat(Q))
    path.write_text("".join(f"{form}\n".format(y=y, p=p, r=r, q=Q[n], n=n) for n, (y, p, r) in enumerate(angles)))
    if answered:
        with pytest.raises(DecodeError, match=r"reference\.columns=3,2,1"):
            plumbob.profile(path)
    draft = plumbob.profile(path, answers={"reference.columns": answered} if answered else None)
    columns = answered or ["?", *columns]
    assert f"columns = {json.dumps(columns)}" in draft.text
    assert "[reference]" in draft.text
    assert "[gyr]" not in draft.text


@pytest.mark.parametrize("kind", LOGS)
def test_what_a_file_says_is_taken_and_the_rest_is_answered(tmp_path, kind):
    recording = drafted(tmp_path, *LOGS[kind])
    imu = recording.imu
    assert imu.t - imu.t[0] == pytest.approx(T, abs=1e-6)
    assert imu.gyr == pytest.approx(GYR, abs=2e-3)
    assert imu.acc == pytest.approx(ACC, abs=1e-2)
    assert imu.mag is None
    assert "idle" not in kind or "mag x" in str(recording.notes)
    assert imu.meta.frame == "ENU"
    if "Julian" in kind:  # 2 460 432.0 is noon of 2024-05-01, as 2 451 545.0 is of 2000-01-01 (Astronomical Almanac)
        assert abs(imu.meta.t0_ns - np.datetime64("2024-05-01T12", "ns").astype(int)) < 1e5
    if "comment" in kind:  # it is known by its names with its frame, and needs no profile
        assert np.array_equal(plumbob.read(tmp_path / LOGS[kind][0]).imu.gyr, imu.gyr)
    if "attitude" in kind or "comment" in kind:
        assert np.abs(np.sum(recording.track.q_nb * Q, axis=1)) == pytest.approx(1.0, abs=1e-6)


def test_what_no_sensor_measures_is_missing_and_columns_that_turn_as_gravity_does_are_rates(tmp_path):
    """Nines alone, far beyond all others, stand for no value; and no place on Earth is without a field."""
    head = "t_s," + names("a* [g]", "g* [dps]", "m* [uT]") + "\n"
    lines = rows(T, *G.T, *DPS.T, *(MAG * (T[:, None] > 1.0)).T).splitlines(True)
    lines[50:400:50] = [line.replace(f"{G[k, 1]:.6f}", "999.9", 1) for k, line in enumerate(lines)][50:400:50]
    recording = drafted(tmp_path, "a.csv", head + "".join(lines), UP)
    assert np.flatnonzero(np.isnan(recording.imu.acc).any(axis=1)).tolist() == list(range(50, 400, 50))
    assert np.flatnonzero(np.isnan(recording.imu.mag).all(axis=1)).tolist() == list(range(101))
    assert any("mag: 101 samples of exactly zero left out" in str(note) for note in recording.notes)
    text = "t_s," + names("Acc.*") + ",Rotation.roll,Rotation.pitch,Rotation.yaw\n" + rows(T, *ACC.T, *DPS.T)
    (tmp_path / "a.csv").write_text(text, encoding="utf-8")
    draft = plumbob.profile(tmp_path / "a.csv").text
    assert 'columns = ["?", "Rotation.roll", "Rotation.pitch", "Rotation.yaw"]' in draft


def test_broken_lines_are_left_out_and_counted(tmp_path):
    name, text, answers = LOGS["a line cut at the end, and some that are broken"]
    lines = text.splitlines(True)
    lines[100], lines[300], lines[301] = "1.0,2.0\n", lines[300].replace(".", "..", 1), "restart\n"
    recording = drafted(tmp_path, name, "".join(lines)[:-4], answers)
    lost = [99, 299, 300, 599]
    assert recording.imu.t == pytest.approx(np.delete(T, lost), abs=1e-9)
    assert recording.imu.acc == pytest.approx(np.delete(ACC, lost, axis=0), abs=1e-4)
    (note,) = [note for note in recording.notes if note.code == "reading.lines_left_out"]
    assert note.values["count"] == 3 and "line 101 has 2 cells" in str(note)
    assert any("line 601, the last, is cut" in str(note) for note in recording.notes)


def test_of_a_rate_alone_lines_that_are_left_out_keep_their_time(tmp_path):
    _, text, answers = LOGS["labels in every cell"]
    lines = text.splitlines(True)
    lines[200] = "ax:0.1\n"
    assert drafted(tmp_path, "a.txt", "".join(lines), answers).imu.t == pytest.approx(np.delete(T, 200))


def test_rows_that_name_their_sensor_are_one_recording(tmp_path):
    sources = (("accel", T, ACC), ("gyro", T + 3e-3, GYR), ("mag", T[::5], MAG[::5]))
    each = ((t, word, v) for word, times, values in sources for t, v in zip(times, values, strict=True))
    long = [(t, f"{word},{1e3 * t:.3f},{v[0]:.6f},{v[1]:.6f},{v[2]:.6f}\n") for t, word, v in each]
    text = "sensor,timestamp_ms,x,y,z\n" + "".join(line for _, line in sorted(long, key=lambda row: row[0]))
    arrays = {word: [dict(zip(("ms", *"xyz"), (1e3 * t, *v), strict=True)) for t, v in zip(*both, strict=True)]
              for word, *both in (*sources[:2], ("mag", T[::5], MAG[::5] / 1e6))}  # fmt: skip
    for name, content in (("a.csv", text), ("b.json", json.dumps(arrays))):
        imu = drafted(tmp_path, name, content, UP | {"gyr.unit": "rad/s"}).imu
        assert len(imu) == T.size - 1  # the last rate is later than every force
        assert imu.gyr == pytest.approx(GYR[:-1], abs=1e-5)
        assert imu.acc == pytest.approx(ACC[:-1] + 0.3 * np.diff(ACC, axis=0), abs=1e-4)  # 3 ms of 10 on the way
        assert imu.mag[np.isfinite(imu.mag).all(axis=1)] == pytest.approx(MAG[::5], abs=1e-5)


def two_files(folder, late=0.0):
    head = "epoch (ms),elapsed (s),"
    ms = [f"{1_700_000_000_000 + 10 * k:.0f}" for k in range(T.size)]
    other = [f"{1_700_000_000_000 + 20 * k + 1e3 * late:.0f}" for k in range(T.size // 2)]
    (folder / "w_gyro.csv").write_text(head + names("*-axis (deg/s)") + "\n" + rows(ms, T, *DPS.T))
    (folder / "w_acc.csv").write_text(head + names("*-axis (g)") + "\n" + rows(other, T[::2], *G[::2].T))
    return [folder / "w_gyro.csv", folder / "w_acc.csv"]


def test_a_file_for_each_sensor_is_one_recording(tmp_path):
    paths, out = two_files(tmp_path), tmp_path / "both.toml"
    draft = plumbob.profile(paths, accept=True, answers=UP | {"frame": "ENU"}, out=out)
    assert draft.summary()["questions"] == {}
    imu = plumbob.read(paths, profile=out).imu
    assert imu.meta.t0_ns == 1_700_000_000_000_000_000
    assert imu.gyr == pytest.approx(GYR[: len(imu)], abs=1e-4)
    assert imu.acc == pytest.approx(ACC[: len(imu)], abs=1e-2)
    assert plumbob.info(paths, profile=out).summary()["sensors"]["time"]["start_utc"] == "2023-11-14T22:13:20Z"
    paths = two_files(tmp_path, late=60.0)
    refused(plumbob.read, paths, profile=out, match="do not overlap in time", error=ClockError)
    refused(plumbob.read, paths[:1], profile=out, match="0 of the files are named w_acc.csv")


def test_a_time_of_week_is_utc(tmp_path):
    text = "GPS TFlags,GPS Week,GPS TOW," + names("* Accel [x8004]", "* Gyro [x8005]") + ",,\n"
    text += "".join(f"5,1969,{row.strip()},,\n" for row in rows(T + 137_649.863104, *G.T, *GYR.T).splitlines())
    imu = drafted(tmp_path, "a.csv", text, UP | {"acc.unit": "g", "gyr.unit": "rad/s"}).imu
    assert abs(imu.meta.t0_ns - np.datetime64("2017-10-02T14:13:51.863104", "ns").astype(int)) <= 1  # of float64
    assert imu.t == pytest.approx(T, abs=1e-6)


def test_arrays_say_their_rate(tmp_path):
    path, out = tmp_path / "a.npz", tmp_path / "a.profile.toml"
    np.savez(path, gyr=GYR, acc=ACC, sampling_rate=np.array([250.0]))
    answers = UP | {"gyr.unit": "rad/s", "acc.unit": "m/s2"}
    draft = plumbob.profile(path, accept=True, answers=answers, out=out)
    assert dict(draft.evidence)["time.rate"] == "the header says it"
    imu = plumbob.read(path).imu
    assert imu.t == pytest.approx(np.arange(T.size) / 250.0)
    assert imu.acc.tobytes() == ACC.tobytes()
    with pytest.importorskip("h5py").File(tmp_path / "a.h5", "w") as file:
        for name, values in (("gyr", GYR), ("acc", ACC)):
            file.create_dataset(name, data=values).attrs["sampling_rate"] = 250.0
    assert "time.rate" in dict(plumbob.profile(tmp_path / "a.h5", accept=True, answers=answers).evidence)
    np.savez(path, **{f"day 3/left_shank/{name}": v for name, v in (("t", T), ("gyr", GYR), ("acc", ACC))})
    draft = plumbob.profile(path, accept=True, answers=answers)  # in folders that name no sensor
    assert plumbob.read(path, profile=plumbob.files.parse_profile(draft.text)).imu.gyr.tobytes() == GYR.tobytes()


UNITS = {"gyr.unit": "rad/s", "mag.unit": "uT"}
OPEN = "t,gx,gy,gz,ax,ay,az\n" + rows(T, *GYR.T, *ACC.T)


def test_what_nothing_speaks_for_stays_a_question_and_nothing_is_written(tmp_path):
    (tmp_path / "a.csv").write_text(OPEN)
    out = tmp_path / "out.toml"
    draft = plumbob.profile(tmp_path / "a.csv", accept=True, out=out)
    assert [key for key, _ in draft.questions] == ["gyr.unit", "acc.sign"]
    head = "// Interval: 0 ms\n// Rate: 100 Hz\nSampleTimeFine," + names("Acc_*", "Gyr_*") + "\n"  # its counts: 0.1 ms
    (tmp_path / "b.csv").write_text(head + rows(1e4 * T, *ACC.T, *DPS.T), encoding="utf-8")
    assert "time.unit" in dict(plumbob.profile(tmp_path / "b.csv", accept=True, answers=UP | UNITS).questions)
    counts = np.rint([*(16384 * G).T, *(131 * DPS).T])  # what a unit alone does not answer
    (tmp_path / "c.csv").write_text("t_s," + names("a*", "g*") + "\n" + rows(T, *counts), encoding="utf-8")
    answers = UP | {"acc.unit": "g", "gyr.unit": "deg/s"}
    draft = plumbob.profile(tmp_path / "c.csv", accept=True, answers=answers)
    assert [key for key, _ in draft.questions] == ["acc.counts_per_unit"]
    assert not out.exists()
    assert plumbob.profile(tmp_path / "a.csv", accept=True, answers=UP | UNITS, out=out).questions == ()
    assert plumbob.read(tmp_path / "a.csv", profile=out).imu.acc == pytest.approx(ACC, abs=1e-5)


@pytest.mark.parametrize(
    ("text", "answers", "match"),
    [
        (OPEN, UP | {"gyr.unit": "m/s"}, "gyr.unit"),
        (OPEN, UP | UNITS | {"frame": "up"}, "frame"),
        ("Time (s)," + names("Linear Acceleration * (m/s^2)") + "\n" + rows(T, *GYR.T), {}, "without gravity"),
        ("t_s," + names("dAngle_*", "dVel_*") + "\n" + rows(T, *SIX), {}, "divide them by its step"),
        ("".join(f"{k},A{axis},0.1,0.2,0.{k % 9}\n" for k in range(99) for axis in "XYZ"), {}, "an axis: AX, AY, AZ"),
        ("t,ax,ay,az\n" + rows(T, *[['"[0.1, 0.2, 0.3]"'] * T.size] * 3), {}, "several samples of an axis"),
        (rows(*np.tile(G[:99, :1], 128).T), {}, "a row is a series of one quantity"),
        ("t," + names("speed_*") + "\n" + rows(T, *ACC.T), {}, "no three columns look like"),
        ("t,data_type," + names("value_*") + "\n" + rows(T, T % 0.02, *GYR.T), {}, "no three columns look like"),
        (LOGS["a unit in each cell"][1].replace(" g,", " mg,", 1000), UP, "is in g, but the column is in mg"),
    ],
)
def test_answers_that_do_not_fit_and_files_that_cannot_give_an_attitude_are_refused(tmp_path, text, answers, match):
    (tmp_path / "a.csv").write_text(text)
    with pytest.raises(plumbob.PlumbobError, match=match):
        plumbob.profile(tmp_path / "a.csv", accept=True, answers=answers)


def test_a_clock_that_begins_again_hides_no_evidence(tmp_path):
    """The rates' unit by how gravity turns, over midnight: about x by 0.5 sin 1.3 t, and so at 0.65 cos 1.3 t."""
    t = np.arange(40.0 * RATE) / RATE
    roll, rate = 0.5 * np.sin(1.3 * t), 0.65 * np.cos(1.3 * t)
    clock = [str(np.datetime64("2024-05-03T23:59:40") + np.timedelta64(round(1e3 * s), "ms"))[11:] for s in t]
    force = (0.0 * t, G0 * np.sin(roll), G0 * np.cos(roll))
    text = "time," + names("a*", "g*") + "\n" + rows(clock, *force, np.degrees(rate), 0.0 * t, 0.0 * t)
    assert drafted(tmp_path, "a.csv", text, UP).imu.gyr[:, 0] == pytest.approx(rate, abs=1e-6)


def test_answers_as_they_are_typed():
    assert answer("frame=ENU") == ("frame", "ENU")
    assert answer("axes = x -y -z") == ("axes", "x -y -z")
    assert answer("acc.counts_per_unit=2048") == ("acc.counts_per_unit", 2048)
    assert answer('gyr.columns=["X", "Y", "Z"]') == ("gyr.columns", ["X", "Y", "Z"])
    with pytest.raises(ParameterError, match="KEY=VALUE"):
        answer("ENU")


def test_the_folder_itself_is_refused_in_a_sentence(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for verb in (plumbob.read, plumbob.info, plumbob.doctor, plumbob.profile, plumbob.estimate):
        with pytest.raises(DecodeError, match="is a folder"):
            verb(".")


def test_a_known_format_does_not_claim_another_loggers_table(tmp_path):
    """phyphox writes its axes in small letters and its own units; this logger does not."""
    path = tmp_path / "log.csv"
    path.write_text("Time (s)," + names("Gyroscope * (deg/s)", "Accelerometer * (g)") + "\n" + rows(T, *SIX))
    refused(plumbob.read, path, match="plumbob profile")
    recording = drafted(tmp_path, "log.csv", path.read_text(), UP)
    assert recording.imu.gyr == pytest.approx(GYR, abs=1e-4)


def sentence(text):
    """With NMEA's checksum: the exclusive or of what stands between ``$`` and ``*``."""
    return f"${text}*{reduce(xor, text.encode()):02X}\r\n"


def test_sentences_with_a_checksum(tmp_path):
    """A VN-100's, beside others on the line; a flipped bit spoils its own sentence alone."""
    lines = [sentence("VNYMR," + ",".join(f"{v:+.5f}" for v in (*np.zeros(3), *b / 100.0, *a, *w)))
             for b, a, w in zip(MAG, ACC, GYR, strict=True)]  # fmt: skip
    lines[70] = lines[70].replace("+", "-", 1)
    lines[10:10] = lines[300:300] = ["$GPGGA,101512,4807.0,N,01131.0,E,1,08,0.9,545,M,46.9,M,,*47\r\n"]
    imu = drafted(tmp_path, "a.txt", "".join(lines), UP | {"time.rate": "100 Hz"}).imu
    assert imu.t == pytest.approx(np.delete(T, 70))
    assert imu.gyr == pytest.approx(np.delete(GYR, 70, axis=0), abs=1e-5)
    assert imu.acc == pytest.approx(np.delete(ACC, 70, axis=0), abs=1e-5)
    assert imu.mag == pytest.approx(np.delete(MAG, 70, axis=0), abs=1e-3)


def test_angles_alone_are_a_track(tmp_path):
    angles = np.degrees(rot.euler_zyx_from_quat(Q))
    texts = {
        "a.txt": "".join(f"#YPR={yaw:.3f},{pitch:.3f},{roll:.3f}\n" for yaw, pitch, roll in angles),
        "b.csv": "Nr,Roll | Phi (degrees), Pitch | Theta (degrees), Yaw | Psi (degrees)\n"
        + rows(map(str, range(T.size)), *angles.T[::-1]),
        "c.csv": "Nr,W,X,Y,Z\n" + rows(map(str, range(T.size)), *Q.T, form="{:.2f}"),  # norms of 0.99 to 1.01
    }
    for name, text in texts.items():
        recording = drafted(tmp_path, name, text, {"time.rate": "100 Hz", "reference.frame": "ENU"})
        assert recording.imu is None
        q = rot.quat_normalize(recording.track.q_nb) if name == "c.csv" else recording.track.q_nb
        assert np.abs(np.sum(q * Q, axis=1)) == pytest.approx(1.0, abs=1e-4 if name == "c.csv" else 1e-8)


def test_columns_without_names_are_not_dealt_out_where_more_could_be_meant(tmp_path):
    text = rows(T, *(0.1 * DPS).T, *ACC.T, *GYR.T)
    (tmp_path / "a.csv").write_text(text)
    questions = dict(plumbob.profile(tmp_path / "a.csv", accept=True, answers=UP).questions)
    assert {"gyr.columns", "acc.columns"} <= set(questions)
    columns = {"acc.columns": [5, 6, 7], "gyr.columns": [8, 9, 10], "gyr.unit": "rad/s"}
    imu = drafted(tmp_path, "a.csv", text, UP | columns).imu
    assert (imu.gyr, imu.acc, imu.mag) == (pytest.approx(GYR, abs=1e-6), pytest.approx(ACC, abs=1e-6), None)
    refused(plumbob.profile, tmp_path / "a.csv", answers={"acc.columns": [1, 2, 11]}, match="column 11, which is not")


def test_columns_that_were_not_asked_are_answered_and_light_a_button_and_warmth_are_no_field(tmp_path):
    text = rows(T // 1, T % 1 * 1e9, *GYR.T, *(-1.1 * G).T, *(0.1 * G).T)
    answers = {"time.column": 2, "time.seconds": 1, "acc.columns": [9, 10, 11], "acc.plus": [6, 7, 8], "acc.unit": "g"}
    answers |= {"gyr.columns": [3, 4, 5], "gyr.unit": "rad/s", "acc.sign": "gravity"}
    imu = drafted(tmp_path, "a.csv", text, answers).imu
    assert (imu.t, imu.acc) == (pytest.approx(T, abs=1e-6), pytest.approx(ACC, abs=1e-2))
    for button, warmth in ((0 * T, 0 * T + 25.9), (1.0 * (T == 3.0), 25.9 + 0.1 * (np.arange(T.size) % 2))):
        (tmp_path / "a.csv").write_text(rows(T, *G.T, T % 8, button, warmth))
        draft = plumbob.profile(tmp_path / "a.csv", accept=True, answers=UP)
        assert "acc.columns" in dict(draft.questions) and "mag" not in draft.text
    (tmp_path / "acc.txt").write_text(rows(*np.reshape(ACC, (-1, 12)).T))  # windows of one axis
    refused(plumbob.profile, tmp_path / "acc.txt", accept=True, match=r"--set acc.columns=1,2,3", name="acc.txt")
    assert answer("acc.columns=1,2,3") == ("acc.columns", [1, 2, 3])


def test_the_sensor_stands_in_the_name_of_the_file(tmp_path):
    files = {"run_gyroscope_1.csv": GYR, "run_accel_1.csv": ACC}
    for name, values in files.items():
        (tmp_path / name).write_text(rows(T, *values.T))
    paths, out = [tmp_path / name for name in files], tmp_path / "both.toml"
    assert plumbob.profile(paths, accept=True, answers=UP | {"gyr.unit": "rad/s"}, out=out).questions == ()
    assert plumbob.read(paths, profile=out).imu.acc == pytest.approx(ACC, abs=1e-6)


def test_blanks_where_another_sensor_has_its_row(tmp_path):
    text = "t,gx,gy,gz,ax,ay,az\n" + "".join(
        f"{g[:8]}{g[8:]},,,\n{a[:8]},,,{a[8:]}\n"
        for g, a in zip(rows(T, *GYR.T).splitlines(), rows(T + 0.002, *ACC.T).splitlines(), strict=True)
    )
    recording = drafted(tmp_path, "a.csv", text, UP | {"gyr.unit": "rad/s"})
    assert recording.imu.t == pytest.approx(T, abs=1e-6)
    assert np.isfinite(recording.imu.acc[1:]).all()
    assert any("rows of their own" in str(note) for note in recording.notes)


def test_several_samples_in_a_line_and_a_toml_of_another_kind_are_refused(tmp_path):
    line = '{"t":1,"acc":[{"x":0.1,"y":0.2,"z":9.8},{"x":0.1,"y":0.2,"z":9.7}],"gyr":[{"x":0,"y":0,"z":0}]}\n'
    (tmp_path / "a.jsonl").write_text(line * 9)
    refused(plumbob.profile, tmp_path / "a.jsonl", match="holds several samples: .*Write a row for each sample")
    path = tmp_path / "arm.csv"
    path.write_text(OPEN)
    (tmp_path / "arm.toml").write_text('kind = "chain"\n[[segment]]\nname = "base"\n')
    refused(plumbob.read, path, match="plumbob profile")
    (tmp_path / "arm.toml").write_text('separator = ","\nseperator = 1\n')
    refused(plumbob.read, path, match="has no key 'seperator'")


def test_rows_of_two_devices_are_asked_for(tmp_path: Path) -> None:
    file = tmp_path / "two.csv"
    rows = [f"{i / 100:.3f},{k},{1.0 + k:.3f},0.1,9.8,{k / 10:.4f},0.02,-0.01\n" for i in range(60) for k in (1, 2)]
    file.write_text("t_s,id,ax,ay,az,gx [rad/s],gy [rad/s],gz [rad/s]\n" + "".join(rows))
    with pytest.raises(DecodeError, match="2 devices or sensors, which column 'id' names: 1, 2"):
        plumbob.profile(file, accept=True)
    assert plumbob.profile(file, accept=True, answers=UP | {"header.where": ["id", "2"]}).questions == ()


@pytest.mark.parametrize(
    ("name", "encoding"),
    [("加速度", "shift_jis"), ("加速度", "gbk"), ("Ускорение ", "cp1251"), ("Beschleunigung ", "utf-16-le")],
)
def test_an_encoding_is_known_by_the_names_that_it_makes(tmp_path: Path, name: str, encoding: str) -> None:
    file = tmp_path / "names.csv"
    head = ";".join(f"{name}{axis} [g]" for axis in "XYZ")
    file.write_bytes(
        (f"t [s];{head}\n" + "".join(f"{0.01 * i:.2f};0;0;{1 + i % 3 / 1e3}\n" for i in range(99))).encode(encoding)
    )
    sample = read_sample(file)
    assert sample.layout.encoding == encoding
    assert taken_apart(sample.names[1]).sensor == "acc"


def test_what_a_log_writes_before_the_first_label_is_of_no_number(tmp_path: Path) -> None:
    file = tmp_path / "log.txt"
    file.write_text(
        "".join(f"2024-05-13 12:30:45,{i:03d} - imu - DEBUG - ax=0.{i} ay=0.2 az=9.8\n" for i in range(100, 200))
    )
    assert read_sample(file).names[1:4] == ("ax", "ay", "az")


@pytest.mark.parametrize(("sign", "cell"), [("\u202f", "1\u202f234,5"), ("'", "1'234.5"), (",", "1,234.5")])
def test_thousands_are_told_by_the_numbers_themselves(tmp_path: Path, sign: str, cell: str) -> None:
    file = tmp_path / "counts.csv"
    file.write_text("t_s;ax_counts\n" + "".join(f"{i};{cell}\n{i};12\n" for i in range(50)))
    layout = read_sample(file).layout
    assert layout.thousands == sign.replace("\u202f", " ")
    assert layout.decimal == ("," if cell.endswith(",5") else ".")
    rows = "".join(f'"{1 + i // 1000},{i % 1000:03d}",0.1,9.{i % 10}\n' for i in range(0, 2000, 10))  # as in 1,000 ms
    file.write_text("t_ms,gx_dps,ax_mps2\n" + rows)
    assert read_sample(file).layout.thousands == ","


def test_accelerometer_and_gyroscope_are_those_of_one_unit(tmp_path: Path) -> None:
    """The foot's acceleration stands first, but only the hand has rates."""
    file = tmp_path / "units.csv"
    names = [f"foot_a{a} [m/s^2]" for a in "xyz"] + [f"hand_a{a} [m/s^2]" for a in "xyz"]
    names += [f"hand_g{a} [rad/s]" for a in "xyz"]
    rows = [f"{0.01 * i:.2f},0.1,0.2,9.7,0.3,0.1,9.{i % 10},0.0{i % 7},0.01,0.02\n" for i in range(200)]
    file.write_text("t_s," + ",".join(names) + "\n" + "".join(rows))
    made = plumbob.profile(file, accept=True)
    assert 'columns = ["hand_ax [m/s^2]", "hand_ay [m/s^2]", "hand_az [m/s^2]"]' in made.text


def test_rates_that_no_name_says_are_told_by_the_accelerometer_in_rows_of_its_own(tmp_path: Path) -> None:
    """As a BNO055 is printed; whole numbers of a magnetometer, whatever its unit is said to be, may be counts."""
    t = np.arange(1500) / RATE
    q = rot.quat_from_euler_zyx(np.stack([np.sin(2.1 * t), 0.5 * np.sin(2.9 * t), 0.6 * np.sin(2.6 * t)], 1))
    w = rot.rotvec_from_quat(rot.quat_multiply(rot.quat_conjugate(q[:-1]), q[1:])) * RATE
    line = "Rot:\tx= {:.5f} |\ty= {:.5f} |\tz= {:.5f}\nAccl:\tx= {:.5f} |\ty= {:.5f} |\tz= {:.5f}\n--\n"
    text = "".join(
        line.format(*a, *b) for a, b in zip(w, rot.quat_rotate(rot.quat_conjugate(q), [0, 0, G0]), strict=False)
    )
    imu = drafted(tmp_path, "a.txt", text, UP | {"time.rate": "100 Hz"}).imu
    assert imu.gyr == pytest.approx(w, abs=1e-4)
    (tmp_path / "m.csv").write_text("t_s," + names("m* (uT)") + "\n" + rows(T, *np.rint(6.6 * MAG).T), encoding="utf-8")
    assert "mag.unit" in dict(plumbob.profile(tmp_path / "m.csv", accept=True).questions)
