"""Refuse a test run in which too little was tested: count_tests.py JUNIT_FILE FLOOR.

Counts the tests that really ran; fewer than the floor mean that some were not collected.
"""

import sys
import xml.etree.ElementTree as ElementTree

suites = ElementTree.parse(sys.argv[1]).getroot().iter("testsuite")
total = skipped = failed = 0
for suite in suites:
    total += int(suite.get("tests", 0))
    skipped += int(suite.get("skipped", 0))
    failed += int(suite.get("failures", 0)) + int(suite.get("errors", 0))
floor = int(sys.argv[2])
if failed or total - skipped < floor:
    sys.exit(f"{total} tests, {skipped} skipped, {failed} failed: not a passing run of at least {floor} tests")
print(f"{total - skipped} tests ran, {skipped} skipped")
