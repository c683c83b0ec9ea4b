"""The gallery shows every recipe that comes with planlang, with the command that made its picture."""

from __future__ import annotations

import shlex

import pytest

from planlang.files import Bundled
from planlang.ontology import load
from planlang.recipe.readers import tasks_of
from tests.support.gallery import CHECKOUT, MOST_BYTES, PAGE, PICTURES, commands
