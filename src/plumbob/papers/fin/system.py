"""System of the fin paper [Ou2017] §1, Figures 2 and 3: parts, chain, and the words on the wire."""

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from plumbob.core.units import to_dps
from plumbob.papers.fin.records import COUNT, RATE
from plumbob.papers.outcome import Outcome
from plumbob.papers.workspace import Work
from plumbob.protocols.decode import decode
from plumbob.protocols.field import Field
from plumbob.protocols.find import find_format
from plumbob.reporting.content import Table
from plumbob.reporting.report import Report
from plumbob.reporting.style import Both

_WORD: Final = """\
kind = "plumbob format"
version = 1
name = "word"
title = "rate word of the ADXRS453, read as {type}"
byte_order = "big"
[frame]
length = 2
[[field]]
name = "gyr.z"
type = "{type}"
unit = "deg/s"
counts = 80
"""
_CHAIN: Final = (
    (
        Both("sensors ADXRS453 (z) and ADXRS290 (x, y)", "陀螺仪 ADXRS453（z）与 ADXRS290（x、y）"),
        Both("presets of both data sheets: noise, counts, ranges", "两器件数据手册的预设：噪声、灵敏度、量程"),
    ),
    (
        Both("AD conversion", "AD 转换"),
        Both(
            "rounding to 1/80 and 1/200 °/s, clipping to ±300 and ±100 °/s",
            "舍入到 1/80、1/200 °/s，限幅 ±300、±100 °/s",
        ),
    ),
    (
        Both("band-pass filter", "带通滤波"),
        Both(
            "off by default; a high-pass by emulate --high-pass, and what it costs is shown below",
            "默认关闭；emulate --high-pass 可接入高通，其代价见下文",
        ),
    ),
    (
        Both("temperature compensation", "温度补偿"),
        Both(
            "calibrate temperature makes a card from a warm-up",
            "calibrate temperature 由预热记录求取标定卡",
        ),
    ),
    (
        Both("registers, 16-bit two's complement, by SPI", "16 位二进制补码寄存器，SPI 读出"),
        Both("both chips' replies stand in the rig's frame as they are on SPI", "两芯片的 SPI 应答原样放入帧中"),
    ),
    (
        Both("acquisition board, USB", "信号采集板，USB"),
        Both(
            "frame of 20 bytes at 500 Hz: counter, clock, CRC-16; emulate sends it by any port, a port's loss and "
            "damage included",
            "500 Hz、20 字节帧：计数、时钟、CRC-16；emulate 可经任意端口发送，并可加入丢帧与误码",
        ),
    ),
    (
        Both("LabVIEW on a notebook", "上位机 LabVIEW"),
        Both("record by a session file; every byte stays in the recording", "由会话文件 record；全部字节保存在记录中"),
    ),
    (
        Both("TXT files", "TXT 文件"),
        Both(
            "write gives .txt, read takes it back to the bit; LabVIEW's .lvm is read too",
            "write 写出 .txt，read 逐位读回；亦可读 LabVIEW 的 .lvm",
        ),
    ),
    (
        Both("MATLAB, offline", "MATLAB 离线处理"),
        Both("allan, estimate and evaluate", "allan、estimate、evaluate"),
    ),
)


def word(folder: Path, kind: str) -> float:
    """Rate of the word 0xFFFF read as ``s16`` or ``u16``, °/s, by a format of your own."""
    file = folder / f"word-{kind}.toml"
    file.write_text(_WORD.format(type=kind), encoding="utf-8")
    frames = decode(b"\xff\xff", file).frames["word"]
    return float(to_dps(np.asarray(frames.columns["gyr.z"])[0]))


def part(work: Work, samples: int) -> tuple[Report, Sequence[Outcome]]:
    """Part of the page, and its outcomes.

    Parameters
    ----------
    work : Work
        Of the run.
    samples : int
        That a record of 220 s had when it was decoded.
    """
    fields = {field.name: field for field in find_format("fin").bind().messages[0].fields}
    z, x = fields["gyr.z"], fields["gyr.x"]
    signed, unsigned = word(work.folder, "s16"), word(work.folder, "u16")
    outcomes = [
        _sheet("system.counts.453", "ADXRS453", "sensitivity", "灵敏度", "LSB/(°/s)", 80.0, _counts(z)),
        _sheet("system.counts.290", "ADXRS290", "sensitivity", "灵敏度", "LSB/(°/s)", 200.0, _counts(x)),
        _sheet("system.range.453", "ADXRS453", "range", "测量范围", "°/s", 300.0, _range(z)),
        _sheet("system.range.290", "ADXRS290", "range", "测量范围", "°/s", 100.0, _range(x)),
        Outcome(
            key="system.rate",
            where="§2, 8)",
            what=Both("sampling rate", "采样频率"),
            unit="Hz",
            paper=500.0,
            faithful=samples / (COUNT / RATE),
            faithful_bar=(499.99, 500.01),
        ),
        Outcome(
            key="system.samples",
            where="§2, 8)",
            what=Both("samples of a record", "数据点总数 N"),
            paper="110000",
            faithful=float(samples),
            faithful_bar=(COUNT, COUNT),
            digits=6,
        ),
        Outcome(
            key="system.word",
            where="§1",
            what=Both("word 0xFFFF, two's complement, ADXRS453", "补码 0xFFFF，ADXRS453"),
            unit="°/s",
            paper="-",
            faithful=signed,
            faithful_bar=(-0.01251, -0.01249),
        ),
        Outcome(
            key="misprint.unsigned",
            where="§1",
            what=Both("the same word read without its sign", "同一字按无符号读取"),
            unit="°/s",
            faithful=unsigned,
            faithful_bar=(819.15, 819.25),
            digits=4,
        ),
    ]
    head = (Both("stage of the paper", "论文环节"), Both("in Plumbob", "Plumbob 中"))
    chain = Table(
        Both("Figures 2 and 3: the chain, stage by stage", "图 2、图 3：系统结构逐级对应"), head, _CHAIN, words=(1,)
    )
    remarks = (
        Both(
            "Figure 1 is a drawing of the mechanism and Figure 3 a photograph; neither holds a number.",
            "图 1 为机构图，图 3 为照片，均不含数据。",
        ),
        Both(
            "Everything below went through the frame's bytes, a session and a recording, unless it says otherwise.",
            "除另有说明外，以下结果均经过真实字节、会话与记录文件。",
        ),
    )
    return Report(Both("System (§1)", "姿态测量系统（§1）"), tables=[chain], remarks=remarks), outcomes


def _sheet(key: str, part: str, en: str, zh: str, unit: str, paper: float, value: float) -> Outcome:
    bar = (paper - 1e-9, paper + 1e-9)
    return Outcome(
        key=key,
        where="§1",
        what=Both(f"{en}, {part}", f"{part} {zh}"),
        unit=unit,
        paper=paper,
        faithful=value,
        faithful_bar=bar,
    )


def _counts(field: Field) -> float:
    return 1.0 / float(to_dps(abs(field.scale)))


def _range(field: Field) -> float:
    return float(to_dps(field.full_scale))
