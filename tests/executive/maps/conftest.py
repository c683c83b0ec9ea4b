"""Fixtures of the tests in this folder."""

from tests.support.map_fixtures import map_of as map_of
from tests.support.map_fixtures import seen as seen
from tests.support.map_fixtures import thing as thing
