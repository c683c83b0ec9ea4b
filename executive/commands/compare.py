"""Comparisons: variants of a sweep in the same worlds."""

from __future__ import annotations

from collections.abc import Mapping

from executive.commands.sweep import swept
from executive.options.running import SweepOptions
from executive.sweeps.comparison import Comparison
from executive.sweeps.variants import variants_of
from planlang.diagnostics import WrongOption
from planlang.words import Option


def compared(options: SweepOptions) -> Comparison:
    """Run a sweep of at least two variants, or the rest of it, and compare them. Raises BadInput."""
    variants = compared_variants(options)
    return Comparison.of(swept(options, command="compare"), variants)


def compared_variants(options: SweepOptions) -> Mapping[str, Mapping[str, str]]:
    """Variants -> what varies, of a comparison. Raises WrongOption if there are less than two."""
    variants = {one.name: one.columns for one in variants_of(options)}
    if len(variants) < 2:
        vary = Option("vary", {"robot": ["amigo", "pr2"]})
        variant = Option("variant", {"mine": {"robot": "my.toml"}})
        raise WrongOption("name two variants at least: ", vary, ", or for each of them ", variant)
    return variants
