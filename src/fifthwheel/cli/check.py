"""fifthwheel check"""

from fifthwheel.cli.app import (
    JsonOption,
    Logs,
    SignalsOption,
    VehicleOption,
    app,
    example,
    read_records,
    read_vehicle,
    say_loads,
)
from fifthwheel.cli.one_stage import (
    AnyLoadOption,
    ConsiderOption,
    FreeOption,
    HoldOption,
    PriorOption,
    SensorOption,
    one_stage,
)


@app.command(
    epilog=example(
        "fifthwheel check drive.csv --vehicle truck.toml",
        "fifthwheel check bend.csv ramp.csv -v truck.toml -s signals.toml",
        "fifthwheel check drive.csv -v truck.toml --hold semitrailer.roll_stiffness",
        "fifthwheel check drive.csv -v truck.toml --free tractor.yaw_inertia --json",
    )
)
def check(
    logs: Logs,
    vehicle: VehicleOption,
    signals: SignalsOption = None,
    hold: HoldOption = None,
    free: FreeOption = None,
    prior: PriorOption = None,
    consider: ConsiderOption = None,
    any_load: AnyLoadOption = False,
    sensor: SensorOption = None,
    as_json: JsonOption = False,
) -> None:
    """Before `identify`: what these logs can tell of the truck, what they cannot, and what would help.

    Reckons, at the values of the vehicle file and without a fit, how well the logs together would tell each parameter,
    and how much better if something were known, driven or logged besides. Lists all that looks wrong with the logs.
    """
    from fifthwheel.identify.outlook import outlook

    truck = read_vehicle(vehicle)
    settings = one_stage(truck, free=free, hold=hold, prior=prior, consider=consider, any_load=any_load, sensor=sensor)
    records = read_records(logs, signals)
    say_loads(truck, records)
    found = outlook(records, truck, settings)
    if as_json:
        print(found.to_json())
    else:
        from fifthwheel.report.outlook import show_outlook

        show_outlook(found)
