#!/usr/bin/env python3
"""Tests of the command line. Usage: run.py PATH-TO-OCTRAD [unittest arguments]"""
import os
import sys
import unittest

if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    os.environ["OCTRAD"] = os.path.abspath(sys.argv[1])
    here = os.path.dirname(os.path.abspath(__file__))
    sys.path.insert(0, here)
    if len(sys.argv) > 2:
        unittest.main(module=None, argv=[sys.argv[0]] + sys.argv[2:])
    suite = unittest.defaultTestLoader.discover(here)
    sys.exit(0 if unittest.TextTestRunner(verbosity=1).run(suite).wasSuccessful() else 1)
