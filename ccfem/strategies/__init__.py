"""Strategies: each turns the stress on a layer into fibre paths. One module a strategy."""

from ccfem.planning.strategy import Amount, LayerStrategy, Strategy, create, named, plan

__all__ = ["Amount", "LayerStrategy", "Strategy", "create", "named", "plan"]
