"""Resources of a kernel compiled for a CUDA device, read from the compiled file without a device.

The file is in ELF; ``.nv.info`` has registers and stack, the kernel's sections have the rest.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warp as wp

__all__ = ["Compiled", "compiled", "read_cubin"]

REGISTERS, STACK = 0x2F, 0x11  # attributes of .nv.info: (symbol, number)
SIZED = 0x04  # format of attributes that start with their size
INSTRUCTION = 16  # bytes


@dataclass(frozen=True)
class Compiled:
    """A compiled kernel.

    Attributes:
        registers: of a thread.
        instructions: in the file, including padding.
        shared: bytes of a block, with 1,024 of CUDA's own and four of Warp's for each lane.
        stack: bytes of a thread, in local memory.
    """

    registers: int
    instructions: int
    shared: int
    stack: int


def compiled(kernel: Any, lanes: int, arch: int = 90) -> Compiled:
    """Return the resources of a kernel in blocks of this number of lanes.

    It is the one loaded by a device of this machine, or is compiled for ``arch``, 90 for sm_90.
    """
    kernel.module.options["block_dim"] = lanes  # the module's default is 256
    folder = Path(wp.config.kernel_cache_dir) / kernel.module.get_module_identifier(lanes)
    found = sorted(folder.glob(f"*.sm{arch}*.cubin"))
    if not found:
        found = wp.compile_aot_module(kernel.module, arch=arch, use_ptx=False)
    (one,) = read_cubin(found[0].read_bytes()).values()
    return one


def read_cubin(data: bytes) -> dict[str, Compiled]:
    """Return the resources of each kernel in a compiled file, by its name.

    Raises:
        ValueError: the file is not CUDA code in ELF.
    """
    if data[:5] != b"\x7fELF\x02":
        raise ValueError("not an ELF file of 64 bits")
    (at,) = struct.unpack_from("<Q", data, 0x28)
    size, count, names_at = struct.unpack_from("<3H", data, 0x3A)
    headers = [struct.unpack_from("<2I4Q2I2Q", data, at + k * size) for k in range(count)]
    names = headers[names_at][4]
    sections = {_text(data, names + header[0]): header for header in headers}
    symbols = _symbols(data, sections)
    numbers: dict[tuple[int, str], int] = {}
    _, _, _, _, begin, length, *_ = sections[".nv.info"]
    for attribute, symbol, number in _attributes(data[begin : begin + length]):
        numbers[attribute, symbols.get(symbol, "")] = number
    found = {}
    for section, header in sections.items():
        if section.startswith(".text."):
            name = section.removeprefix(".text.")
            shared = sections.get(f".nv.shared.{name}")
            # ABIs before the eighth have the registers in the header of the section.
            registers = numbers.get((REGISTERS, name), header[7] >> 24)
            found[name] = Compiled(
                registers,
                header[5] // INSTRUCTION,
                shared[5] if shared else 0,
                numbers.get((STACK, name), 0),
            )
    return found


def _attributes(info: bytes) -> Iterator[tuple[int, int, int]]:
    """Yield attribute, symbol and number of each pair in ``.nv.info``."""
    at = 0
    while at + 4 <= len(info):
        form, attribute, size = struct.unpack_from("<2BH", info, at)
        at += 4
        if form == SIZED:
            if size == 8:
                yield attribute, *struct.unpack_from("<2I", info, at)
            at += size


def _symbols(data: bytes, sections: dict[str, tuple[int, ...]]) -> dict[int, str]:
    """Return the names of symbols by their numbers."""
    _, _, _, _, at, size, *_ = sections[".symtab"]
    texts = sections[".strtab"][4]
    entries = range(size // 24)
    return {k: _text(data, texts + struct.unpack_from("<I", data, at + 24 * k)[0]) for k in entries}


def _text(data: bytes, at: int) -> str:
    return data[at : data.index(b"\0", at)].decode()
