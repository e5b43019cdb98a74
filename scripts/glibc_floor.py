#!/usr/bin/env python3
"""Checks that ELF files ask for no newer glibc than one that is named, and can turn single requirements into weak ones.

    glibc_floor.py --newest 2.34 [--weaken SYMBOL...] FILE...

A file that needs a newer version is an error, which names the symbols. With --weaken, requirements of newer versions are marked as
weak (VER_FLG_WEAK of the ELF version table, "Linux Standard Base", 10.7), in place, if only these symbols need them: an older glibc
then loads the file, and only a call of such a function would end the program.
"""
import argparse
import re
import struct
import subprocess
import sys

SHT_GNU_VERNEED = 0x6FFFFFFE
VER_FLG_WEAK = 2


def number(version):
    return tuple(int(part) for part in version.split("."))


def requirements(data):
    """(offset of the entry, name, flags) of every version that a 64-bit little-endian ELF file asks of its libraries."""
    if data[:6] != b"\x7fELF\x02\x01":
        sys.exit("not a 64-bit little-endian ELF file")
    (table,) = struct.unpack_from("<Q", data, 0x28)
    size, count = struct.unpack_from("<HH", data, 0x3A)
    sections = [struct.unpack_from("<IIQQQQIIQQ", data, table + k * size) for k in range(count)]
    for section in sections:
        if section[1] != SHT_GNU_VERNEED:
            continue
        strings = sections[section[6]][4]
        at = section[4]
        for _ in range(section[7]):
            _, entries, _, first, following = struct.unpack_from("<HHIII", data, at)
            entry = at + first
            for _ in range(entries):
                _, flags, _, name, step = struct.unpack_from("<IHHII", data, entry)
                begin = strings + name
                yield entry, data[begin:data.index(b"\0", begin)].decode(), flags
                entry += step
            at += following


def users(file, version):
    """Symbols of this version that the file does not define."""
    lines = subprocess.run(["objdump", "-T", file], check=True, capture_output=True, text=True).stdout.splitlines()
    return sorted(line.split()[-1] for line in lines if "*UND*" in line and re.search(r"\(?\b%s\)?\s" % re.escape(version), line))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--newest", required=True)
    parser.add_argument("--weaken", action="append", default=[], metavar="SYMBOL")
    parser.add_argument("files", nargs="+")
    args = parser.parse_args()
    for file in args.files:
        with open(file, "rb") as source:
            data = bytearray(source.read())
        changed = False
        for entry, name, flags in list(requirements(data)):
            if not re.fullmatch(r"GLIBC_[0-9.]+", name) or number(name[6:]) <= number(args.newest) or flags & VER_FLG_WEAK:
                continue
            symbols = users(file, name)
            if not symbols or not set(symbols) <= set(args.weaken):
                sys.exit("%s needs %s for %s; only %s may be needed" % (file, name, ", ".join(symbols) or "nothing named", args.newest))
            struct.pack_into("<H", data, entry + 4, flags | VER_FLG_WEAK)
            changed = True
        if changed:
            with open(file, "wb") as out:
                out.write(data)


if __name__ == "__main__":
    main()
