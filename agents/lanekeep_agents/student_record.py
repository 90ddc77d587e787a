"""What a policy with memory is, beside its record: controllers that it listens to, and products of what it knows."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from lanekeep_agents.identified import IDENTIFIED, READ
from lanekeep_env.checks import from_mapping, plain_numbers, require, shown

#: Controllers beside the one that is corrected, products, terms of a side, factors of a term, and numbers of a
#: controller's memory that may be named: more than any policy needs, and few enough to be quick.
MOST_BESIDE, MOST_PRODUCTS, MOST_TERMS, MOST_FACTORS, MOST_ESTIMATES = 4, 8, 512, 4, 64
#: Factors that are no channels: one, and s/m of the speed, 6 m/s at the least.
ONE, SLOWNESS = "1", "slowness"
_BASE = re.compile(r"base([0-9])(?:\.([0-9]{1,2}))?")


@dataclass(frozen=True)
class Product:
    """Adds sum_ij left_i W_ij right_j to the correction, W a tensor; a term is a product of factors, "a*b".

    Factors are "1", channels that the policy reads, "slowness" (1 / speed, s/m, from 6 m/s on), "base0" (the action of
    the controller that is corrected; "base1" of the first beside it), "base0.3" (number 3 of what it remembers, its
    estimates) and "identified.NAME" with a NAME of `IDENTIFIED`.
    """

    left: tuple[str, ...]
    right: tuple[str, ...]

    def __post_init__(self) -> None:
        for side in ("left", "right"):
            terms = getattr(self, side)
            if not isinstance(terms, Sequence) or isinstance(terms, str) or not 1 <= len(terms) <= MOST_TERMS:
                raise ValueError(
                    f"student.products.{side}={shown(terms)} is not allowed: it must be a list of 1 to {MOST_TERMS}"
                )
            for term in terms:
                if not isinstance(term, str) or not 1 <= len(factors_of(term)) <= MOST_FACTORS:
                    raise ValueError(
                        f"student.products.{side} has the term {shown(term)}; it must be text of at most {MOST_FACTORS}"
                        " factors, such as 'speed*base0'"
                    )
            object.__setattr__(self, side, tuple(terms))


@dataclass(frozen=True)
class Student:
    """A correction of a controller by sums of products of what the drive has told.

    Attributes:
        beside: controllers that are listened to beside the record's base.
        fade: seconds after which a share 1/e of what was identified is left.
        products: whose sum is the correction.
    """

    beside: tuple[str, ...]
    fade: float
    products: tuple[Product, ...]

    _parts: ClassVar[Mapping[str, Callable[[Any], Any]]] = {}

    def __post_init__(self) -> None:
        names = self.beside
        if not isinstance(names, Sequence) or isinstance(names, str) or len(names) > MOST_BESIDE:
            raise ValueError(f"student.beside={shown(names)} is not allowed: it must be {MOST_BESIDE} names at most")
        for name in names:
            if not isinstance(name, str) or not name:
                raise ValueError(f"student.beside={shown(names)} is not allowed: it must be a list of names")
        object.__setattr__(self, "beside", tuple(names))
        require("student.fade", self.fade, "s", at_least=0.1, at_most=1e6)
        given = self.products
        if not isinstance(given, Sequence) or isinstance(given, str) or not 1 <= len(given) <= MOST_PRODUCTS:
            raise ValueError(
                f"student.products={shown(given)} is not allowed: it must be a list of 1 to {MOST_PRODUCTS}"
            )
        object.__setattr__(self, "products", tuple(_product(one, i) for i, one in enumerate(given)))
        plain_numbers(self)

    @property
    def terms(self) -> tuple[str, ...]:
        """All terms, side by side."""
        return tuple(term for product in self.products for side in (product.left, product.right) for term in side)

    def check(self, channels: Sequence[str]) -> None:
        """Raise ValueError for a factor that is none where the policy reads these channels, or a channel too few."""
        for name in READ:
            if name not in channels:
                raise ValueError(f"channels lack {name!r}, which a student identifies its car from")
        bases = 1 + len(self.beside)
        for factor in {factor for term in self.terms for factor in factors_of(term)}:
            found = _BASE.fullmatch(factor)
            known = factor in (ONE, SLOWNESS, *channels, *(f"identified.{name}" for name in IDENTIFIED))
            if not known and (found is None or int(found[1]) >= bases or int(found[2] or 0) >= MOST_ESTIMATES):
                raise ValueError(
                    f"student.products has the factor {shown(factor)}; allowed are 1, slowness, the channels, base0 to "
                    f"base{bases - 1}, their estimates (base0.3), and identified.{', identified.'.join(IDENTIFIED)}"
                )


def factors_of(term: str) -> list[str]:
    """The factors of a term."""
    return term.split("*")


def base_of(factor: str) -> tuple[int, int | None] | None:
    """Number of the controller, and of what it remembers (None: its action), of a factor that is one's."""
    found = _BASE.fullmatch(factor)
    return None if found is None else (int(found[1]), None if found[2] is None else int(found[2]))


def _product(value: Any, number: int) -> Product:
    if isinstance(value, Product):
        return value
    if not isinstance(value, Mapping):
        raise ValueError(f"student.products[{number}]={shown(value)} is not allowed: it must be a mapping")
    for side in ("left", "right"):
        if side not in value:
            raise ValueError(f"student.products[{number}] lacks the field {side!r}")
    return from_mapping(Product, value, f"student.products[{number}]")
