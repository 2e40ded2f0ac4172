"""The base of our blocks: ports, numeric parameters and state by name, laws that read them, and every scalar.

    @convertible()
    class TorqueLimit(Block):
        def __init__(self, tau_max):
            n = self.parameter("tau_max", tau_max)
            self.input("tau_cmd", n)
            self.output("tau", n, limited_torque)  # a function of tau_cmd and tau_max

A law is a pure function.  Its arguments are read by their names: of input ports, numeric parameters, the state, the
time `t` [s], or plain attributes.  An output depends on what its law takes, and on nothing else, so the feed-through
that Drake is told of is that of the law.
"""

import inspect
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from types import ModuleType
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike
from pydrake.autodiffutils import AutoDiffXd
from pydrake.common.value import AbstractValue, Value
from pydrake.symbolic import Expression
from pydrake.systems import scalar_conversion
from pydrake.systems.framework import (
    BasicVector_,
    DependencyTicket,
    InputPort,
    LeafSystem,
    LeafSystem_,
    NumericParameterIndex,
    ValueProducer,
)
from pydrake.systems.scalar_conversion import TemplateSystem

from flipdiagram.arrays import Array
from flipdiagram.blocks._checks import channels, same_form, sampling
from flipdiagram.errors import InputError

ScalarContext = Any
"""Context_[T]: pydrake's stubs type arrays as ndarray[float64], which fits no other T."""
Law = Callable[..., Any]


class Block(LeafSystem):
    """A Drake LeafSystem whose parts are declared by name, over float; over every scalar where made `convertible`.

    A convertible block has been begun when its `__init__` runs, and keeps each argument of it as an attribute of its
    name: conversion to another scalar builds it again from them.  Parameters changed in a Context are carried over by
    `SetTimeStateAndParametersFrom`.
    """

    scalar: type = float
    """T: float, AutoDiffXd or Expression."""
    numeric_parameter_names: tuple[str, ...] = ()
    """In the order of the Context; `compiled` calls them so."""
    laws: dict[str, tuple[Law, int | None]]
    """By output port or intermediate: its law, and which of the law's values it is where one law has several."""
    state_name: str | None = None
    next_state: Law | None = None
    _sources: dict[str, tuple[Callable[[ScalarContext], Any], DependencyTicket]]
    _parameters: dict[str, tuple[int, Callable[..., Array]]]

    def __init__(self) -> None:
        LeafSystem.__init__(self)
        self._begin()

    def _begin(self) -> None:
        self._sources = {"t": (lambda context: context.get_time(), self.time_ticket())}
        self._parameters, self.laws = {}, {}

    def input(self, name: str, size: int | AbstractValue) -> None:
        """Declare an input port, a vector of `size` or an abstract value."""
        declare = self.DeclareVectorInputPort if isinstance(size, int) else self.DeclareAbstractInputPort
        port: InputPort = declare(name, size)
        self._sources[name] = port.Eval, port.ticket()

    def parameter(
        self,
        name: str,
        value: ArrayLike,
        size: int | None = None,
        check: Callable[..., Array] = channels,
        **bounds: Any,
    ) -> int:
        """Declare a numeric parameter of the Context, kept in the form of `value`, by default one number per channel.

        `check(name, value, size, **bounds)` is asked for the valid array, now and in `set_parameters`; the default
        becomes the attribute `name`.  Returns the number of channels.
        """
        default = check(name, value, size, **bounds)
        setattr(self, name, default)
        index = self.DeclareNumericParameter(BasicVector_[self.scalar](default.ravel()))
        shape = default.shape

        def read(context: ScalarContext) -> Array:
            values = context.get_numeric_parameter(index).CopyToVector()
            return values if len(shape) == 1 else values.reshape(shape)

        self.numeric_parameter_names = (*self.numeric_parameter_names, name)
        self._parameters[name] = index, lambda given: check(name, given, len(default), **bounds)
        self._sources[name] = read, self.numeric_parameter_ticket(NumericParameterIndex(index))
        return len(default)

    def state(self, name: str, initial: Any) -> Any:
        """Declare the discrete state, its size (all 0) or its initial value; returns Drake's index of it."""
        sized = isinstance(initial, int)
        index = self.DeclareDiscreteState(initial if sized else np.array([self.scalar(x) for x in initial]))
        self.state_name = name
        self._sources[name] = (
            lambda context: context.get_discrete_state_vector().CopyToVector(),
            self.discrete_state_ticket(index),
        )
        return index

    def abstract_state(self, name: str, initial: Any, read: Callable[[ScalarContext], Any]) -> int:
        """Declare a state that is any object, read from the Context by `read`; returns its index."""
        index = self.DeclareAbstractState(Value[object](initial) if initial is not None else Value[object]())
        self._sources[name] = read, self.abstract_state_ticket(index)
        return int(index)

    def output(self, name: str, size: int, law: Law) -> None:
        """Declare an output port, the value of a law, shape (size,)."""
        self.laws[name] = law, None
        evaluate, tickets = self._evaluated(law)
        self.DeclareVectorOutputPort(name, size, lambda context, output: output.set_value(evaluate(context)), tickets)

    def outputs(self, names: Sequence[str], size: int, law: Law) -> None:
        """Declare output ports, shape (size,), of the values of one law, which runs once for all of them."""
        read, ticket = self._evaluated_once(", ".join(names), law)
        for i, name in enumerate(names):
            self.laws[name] = law, i
            self.DeclareVectorOutputPort(
                name, size, lambda context, output, i=i: output.set_value(read(context)[i]), {ticket}
            )

    def intermediate(self, name: str, law: Law) -> None:
        """Declare a law's value that other laws take by its name; it runs once for all of them."""
        self.laws[name] = law, None
        self._sources[name] = self._evaluated_once(name, law)

    def update(self, law: Law, period: float, offset: float = 0.0) -> None:
        """Declare that the state becomes a law's value each `period`, first at `offset` [s]; both become attributes."""
        self.period, self.offset = sampling(period, offset)
        self.next_state = law
        evaluate, _ = self._evaluated(law)
        self.DeclarePeriodicDiscreteUpdateEvent(
            self.period, self.offset, lambda context, values: values.set_value(evaluate(context))
        )

    def set_parameters(self, context: ScalarContext, **values: ArrayLike) -> None:
        """Set numeric parameters by name in `context`, shape as built, or one number for all channels."""
        for name, value in values.items():
            if name not in self._parameters:
                raise InputError.of("parameter", name, list(self._parameters))
            index, check = self._parameters[name]
            given = same_form(name, check(value), getattr(self, name))
            context.get_mutable_numeric_parameter(index).SetFromVector(given.ravel())

    def value_in(self, context: ScalarContext, name: str) -> Any:
        """What an input, parameter or state is in `context`."""
        return self._sources[name][0](context)

    def _evaluated(self, law: Law) -> tuple[Callable[[ScalarContext], Any], set[DependencyTicket]]:
        """The law as a function of the Context, and what it depends on."""
        reads, tickets = [], {self.nothing_ticket()}
        for name in inspect.signature(law).parameters:
            if name in self._sources:
                read, ticket = self._sources[name]
                tickets.add(ticket)
            else:
                read = partial(_constant, getattr(self, name))
            reads.append(read)
        return lambda context: law(*[read(context) for read in reads]), tickets

    def _evaluated_once(self, name: str, law: Law) -> tuple[Callable[[ScalarContext], Any], DependencyTicket]:
        """The law as a function of the Context that runs when what it depends on has changed, and its ticket."""
        evaluate, tickets = self._evaluated(law)
        producer = ValueProducer(
            allocate=lambda: Value[object](), calc=lambda context, value: value.set_value(evaluate(context))
        )
        entry = self.DeclareCacheEntry(name, producer, tickets)
        return entry.Eval, entry.ticket()


def _constant(value: Any, context: ScalarContext) -> Any:
    return value


@contextmanager
def _told_of(scope: ModuleType) -> Iterator[None]:
    """Tell Drake the module of a class that it makes: to find it on the call stack takes half of our whole import."""
    method = scalar_conversion.TemplateMethod
    scalar_conversion.TemplateMethod = partial(method, scope=scope)
    try:
        yield
    finally:
        scalar_conversion.TemplateMethod = method


B = TypeVar("B", bound=Block)


def convertible(*scalars: type) -> Callable[[type[B]], type[B]]:
    """Make a Block a Drake system over the scalars, by default float, AutoDiffXd and Expression.

    What is returned is the system over float, which Drake converts to the others; the class decorated is its pattern.
    """

    def convert(pattern: type[B]) -> type[B]:
        arguments = [name for name in inspect.signature(pattern).parameters if name != "self"]
        # Copied, not inherited: nanobind's classes have one base, and Drake's is another for each scalar.
        methods = {
            name: value
            for owner in (Block, pattern)
            for name, value in vars(owner).items()
            if name == "__doc__" or not name.startswith("__")
        }

        def over(T: Any) -> type:
            def construct(self: Any, *given: Any, converter: Any = None, **named: Any) -> None:
                LeafSystem_[T].__init__(self, converter=converter)
                self._begin()
                pattern.__init__(self, *given, **named)

            def construct_copy(self: Any, other: Any, converter: Any = None) -> None:
                construct(self, converter=converter, **{name: getattr(other, name) for name in arguments})

            body = {**methods, "scalar": T, "_construct": construct, "_construct_copy": construct_copy}
            body["__signature__"] = inspect.signature(pattern)  # what help() and editors show
            return type(LeafSystem_[T])(pattern.__name__, (LeafSystem_[T],), body)

        scope = sys.modules[pattern.__module__]
        template = TemplateSystem.define(
            f"{pattern.__name__}_", scalars or (float, AutoDiffXd, Expression), scope=scope
        )
        with _told_of(scope):
            system: type[B] = template(over)[None]
        return system

    return convert
