"""Registered drivers of the devices of a rig: those of the project, and those that other packages add.

A driver is a class that implements the interface of one device (`hil_tests.harness.interfaces`). Its constructor takes
a `DriverContext` and, as further parameters, the options of the rig file; a parameter without a default value is
required. The class attribute `is_virtual` is true for a driver that works on the emulated world of a virtual rig.

Another package adds a driver by an entry point of the group ``taxel.hil_drivers`` with the name ``DEVICE.DRIVER``.
"""

import inspect
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final, get_type_hints

from hil_tests.harness.errors import RigError
from hil_tests.harness.interfaces import INTERFACES
from taxel.errors import TaxelError
from taxel.plugins import HIL_DRIVERS, list_plugin_names, load_plugin

DRIVERS: Final[Mapping[str, str]] = MappingProxyType(
    {
        "clock.monotonic": "hil_tests.harness.physical.clock:MonotonicClock",
        "clock.virtual": "hil_tests.harness.virtual.clock:VirtualClock",
        "uart.serial": "hil_tests.harness.physical.uart:SerialUart",
        "uart.virtual": "hil_tests.harness.virtual.uart:VirtualUart",
        "i2c.linux": "hil_tests.harness.physical.i2c_bus:LinuxI2cBus",
        "i2c.virtual": "hil_tests.harness.virtual.i2c_bus:VirtualI2cBus",
        "can.python-can": "hil_tests.harness.physical.can_bus:PythonCanBus",
        "can.virtual": "hil_tests.harness.virtual.can_bus:VirtualCanBus",
        "can_faults.virtual": "hil_tests.harness.virtual.can_faults:VirtualCanFaults",
        "power.modem-line": "hil_tests.harness.physical.power:ModemLinePower",
        "power.virtual": "hil_tests.harness.virtual.power:VirtualPower",
        "faults.virtual": "hil_tests.harness.virtual.fault_injector:VirtualFaultInjector",
        "stimulus.operator": "hil_tests.harness.physical.stimulus:OperatorStimulus",
        "stimulus.virtual": "hil_tests.harness.virtual.stimulus:VirtualStimulus",
        "counts.virtual": "hil_tests.harness.virtual.raw_counts:VirtualRawCounts",
    }
)
"""Drivers of the project: device and driver name, and the class."""

OPTION_TYPES: Final = (str, bool, int, float)


@dataclass(frozen=True)
class DriverOption:
    """One option of a driver in rig files."""

    name: str
    type: type
    is_required: bool


@dataclass(frozen=True)
class RegisteredDriver:
    """A driver class with the options that its constructor takes."""

    device: str
    name: str
    driver_class: type[Any]
    options: tuple[DriverOption, ...]
    is_virtual: bool


def list_driver_names(device: str) -> tuple[str, ...]:
    """List the names of all drivers of a device alphabetically. Raises `PluginError` if two packages use one name."""
    prefix = f"{device}."
    names = list_plugin_names(HIL_DRIVERS, DRIVERS)
    return tuple(sorted(name.removeprefix(prefix) for name in names if name.startswith(prefix)))


def load_driver(device: str, name: str) -> RegisteredDriver:
    """Load the driver `name` of a device and read the options of its constructor.

    Raises `KeyError` for an unknown name, and `TaxelError` with a one-line message for a driver that cannot be
    imported or that does not implement the interface of the device.
    """
    driver_class = load_plugin(HIL_DRIVERS, f"{device}.{name}", DRIVERS)
    interface = INTERFACES[device]
    where = f"driver '{device}.{name}'"
    if not isinstance(driver_class, type):
        raise RigError(f"{where}: expected a class, found an object of type {type(driver_class).__name__}")
    missing = [method for method in _list_methods(interface) if not callable(getattr(driver_class, method, None))]
    if missing:
        raise RigError(
            f"{where}: class {driver_class.__name__} does not implement {interface.__name__}; "
            f"add the methods {', '.join(missing)}"
        )
    options = _read_options(where, driver_class)
    return RegisteredDriver(device, name, driver_class, options, bool(getattr(driver_class, "is_virtual", False)))


def open_driver(driver: RegisteredDriver, context: Any, options: Mapping[str, Any]) -> Any:
    """Create a driver of the rig and open its device. Raises `TaxelError` with a one-line message if the device
    cannot be opened.
    """
    try:
        return driver.driver_class(context, **options)
    except TaxelError:
        raise
    except OSError as error:
        raise RigError(f"[{driver.device}] driver '{driver.name}' cannot be opened ({error})") from None


def _list_methods(interface: type) -> list[str]:
    """List the names of the public methods of an interface."""
    return [name for name, value in vars(interface).items() if inspect.isfunction(value) and not name.startswith("_")]


def _read_options(where: str, driver_class: type[Any]) -> tuple[DriverOption, ...]:
    """Read the options that a rig file may give to a driver from the signature of the driver's constructor.

    where: name of the driver for error messages. The parameters `self` and `context` are not options. Raises
    `RigError` for a parameter whose type is not in `OPTION_TYPES`.
    """
    constructor = driver_class.__init__
    types = get_type_hints(constructor)
    options = []
    for parameter in list(inspect.signature(constructor).parameters.values())[2:]:  # after `self` and the context
        option_type = types.get(parameter.name)
        if option_type not in OPTION_TYPES:
            raise RigError(
                f"{where}: parameter '{parameter.name}' of {driver_class.__name__} has the type {option_type}; "
                f"expected one of {', '.join(kind.__name__ for kind in OPTION_TYPES)}"
            )
        options.append(DriverOption(parameter.name, option_type, parameter.default is parameter.empty))
    return tuple(options)
