"""Remove statements that nothing depends on."""

from __future__ import annotations

from collections.abc import Iterable, Set
from dataclasses import replace

from mapmore_cli.modelling.program.statements import Block, Choose, Keep, Let, Program, Queue, Recall, Statement, Use
from mapmore_cli.modelling.terms import Expression
from mapmore_cli.modelling.terms.syntax import ZERO


def pruned(model: Program) -> Program:
    """Return the program with only the statements that its results and its memory depend on."""
    functions = tuple(replace(function, body=pruned_block(function.body)) for function in model.functions)
    checked = _names(side for limit in model.limits for side in (limit.value, limit.at or ZERO))
    body = pruned_block(model.body, checked)
    used = _functions_of(body, {function.name: function.body for function in functions})
    return replace(model, functions=tuple(one for one in functions if one.name in used), body=body)


def pruned_block(block: Block, also: Set[str] = frozenset()) -> Block:
    """Return the block with only the statements that its results, its memory and the names in `also` depend on."""
    used = _names(block.results) | also
    kept: list[Statement] = []
    for statement in reversed(block.statements):
        found = _used(statement, used)
        if found is not None:
            kept.append(found)
            used |= names_of(found)
    return Block(tuple(reversed(kept)), block.results)


def names_of(statement: Statement) -> set[str]:
    """Return every name that a statement uses."""
    match statement:
        case Let(_, value) | Keep(_, value) | Queue(_, value):
            return set(value.names)
        case Use(_, _, arguments):
            return _names(arguments)
        case Choose(_, cases, otherwise):
            conditions = _names(side for condition, _ in cases for side in (condition.left, condition.right))
            return conditions.union(*(names_in(block) for _, block in cases), names_in(otherwise))
        case Recall():
            return set()


def names_in(block: Block) -> set[str]:
    """Return every name that a block uses."""
    return _names(block.results).union(*(names_of(statement) for statement in block.statements))


def _used(statement: Statement, used: set[str]) -> Statement | None:
    """Return the part of a statement that is used; None where nothing is."""
    match statement:
        case Let(name) | Recall(name):
            return statement if name in used else None
        case Use(names):
            return statement if used & set(names) else None
        case Choose(names, cases, otherwise):
            places = [place for place, name in enumerate(names) if name in used]
            if not places:
                return None
            parts = [
                pruned_block(Block(block.statements, tuple(block.results[i] for i in places)))
                for block in (*(b for _, b in cases), otherwise)
            ]
            return Choose(tuple(names[i] for i in places), tuple(zip((c for c, _ in cases), parts, strict=False)), parts[-1])
    return statement


def _functions_of(block: Block, bodies: dict[str, Block]) -> set[str]:
    """Return the names of the functions that a block uses, directly or not."""
    found: set[str] = set()
    for statement in block.statements:
        match statement:
            case Use(_, function):
                found |= {function} | _functions_of(bodies[function], bodies)
            case Choose(_, cases, otherwise):
                found = found.union(*(_functions_of(inside, bodies) for inside in (*(b for _, b in cases), otherwise)))
    return found


def _names(expressions: Iterable[Expression]) -> set[str]:
    return {name for expression in expressions for name in expression.names}
