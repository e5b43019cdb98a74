#!/usr/bin/env python3
"""Checks that ELF files ask for no newer glibc than one that is named, and can take the versions from single symbols.

    glibc_floor.py --newest 2.34 [--unversion SYMBOL...] FILE...

A file that needs a newer version is an error, which names the symbols. With --unversion, a newer version that only these symbols need is
taken out of the file's requirements, in place (.gnu.version_r and .gnu.version: "Linux Standard Base", 10.7): an older glibc then loads
the file, and only a call of such a function would end the program; a newer one provides it as before.
"""
import argparse
import re
import struct
import subprocess
import sys

VERNEED, VERSYM = 0x6FFFFFFE, 0x6FFFFFFF  # types of sections
ANY_VERSION = 1  # VER_NDX_GLOBAL


def number(version):
    return tuple(int(part) for part in version.split("."))


def sections(data):
    """(type, offset, bytes, linked section, entries) of each section of a 64-bit little-endian ELF file."""
    if data[:6] != b"\x7fELF\x02\x01":
        sys.exit("not a 64-bit little-endian ELF file")
    (table,) = struct.unpack_from("<Q", data, 0x28)
    size, count = struct.unpack_from("<HH", data, 0x3A)
    rows = [struct.unpack_from("<IIQQQQIIQQ", data, table + k * size) for k in range(count)]
    return [(row[1], row[4], row[5], row[6], row[7]) for row in rows]


def requirements(data):
    """(name, index in .gnu.version, offset of the library's record, offset of what links to the entry, offset of the entry) of
    every version that the file asks of its libraries."""
    parts = sections(data)
    for kind, at, _, linked, count in parts:
        if kind != VERNEED:
            continue
        strings = parts[linked][1]
        for _ in range(count):
            _, entries, _, first, following = struct.unpack_from("<HHIII", data, at)
            entry, link = at + first, at + 8
            for _ in range(entries):
                _, _, index, name, step = struct.unpack_from("<IHHII", data, entry)
                begin = strings + name
                yield data[begin:data.index(b"\0", begin)].decode(), index, at, link, entry
                entry, link = entry + step, entry + 12
            at += following


def take_out(data, index, record, link, entry):
    """The entry leaves its list; symbols of its version may have any."""
    (step,) = struct.unpack_from("<I", data, entry + 12)
    (before,) = struct.unpack_from("<I", data, link)
    struct.pack_into("<I", data, link, before + step if step else 0)
    (count,) = struct.unpack_from("<H", data, record + 2)
    if count < 2:
        sys.exit("the only version that is asked of its library")
    struct.pack_into("<H", data, record + 2, count - 1)
    for kind, at, size, _, _ in sections(data):
        if kind != VERSYM:
            continue
        for place in range(at, at + size, 2):
            (version,) = struct.unpack_from("<H", data, place)
            if version & 0x7FFF == index:
                struct.pack_into("<H", data, place, ANY_VERSION)


def users(file, version):
    """Symbols of this version that the file does not define."""
    lines = subprocess.run(["objdump", "-T", file], check=True, capture_output=True, text=True).stdout.splitlines()
    return sorted(line.split()[-1] for line in lines if "*UND*" in line and re.search(r"\(?\b%s\)?\s" % re.escape(version), line))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--newest", required=True)
    parser.add_argument("--unversion", action="append", default=[], metavar="SYMBOL")
    parser.add_argument("files", nargs="+")
    args = parser.parse_args()
    for file in args.files:
        with open(file, "rb") as source:
            data = bytearray(source.read())
        changed = False
        while True:
            new = [row for row in requirements(data) if re.fullmatch(r"GLIBC_[0-9.]+", row[0]) and number(row[0][6:]) > number(args.newest)]
            if not new:
                break
            symbols = users(file, new[0][0])
            if not symbols or not set(symbols) <= set(args.unversion):
                sys.exit("%s needs %s for %s; only %s may be needed" % (file, new[0][0], ", ".join(symbols) or "nothing named", args.newest))
            take_out(data, *new[0][1:])
            changed = True
        if changed:
            with open(file, "wb") as out:
                out.write(data)


if __name__ == "__main__":
    main()
