"""Baked cards, the last level of detail: a plan of where they stand, and their texture for any season."""

from forestgen.render.card_atlas import bake_cards
from forestgen.render.card_plan import CardPlan, plan_cards

__all__ = ["CardPlan", "bake_cards", "plan_cards"]
