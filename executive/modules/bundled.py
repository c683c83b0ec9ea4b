"""The process modules that come with planlang. Those that few plans need are imported when one needs them.

For these it is stated here what their class says: name, action classes, failures.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from executive.modules import perception, process_modules
from executive.modules.platform import Platform
from planlang.designators import Action, Object
from planlang.diagnostics import Diagnostic
from planlang.failures import (
    DesignatorFailure,
    EnvironmentManipulationFailure,
    GripperFailure,
    LookingFailure,
    ManipulationFailure,
    NavigationFailure,
    ObjectNowhereToBeFound,
    PerceptionFailure,
)
from planlang.modules import ModuleRegistry, OnDemand, Rank

_HAND_WORK = (EnvironmentManipulationFailure, ManipulationFailure, NavigationFailure, DesignatorFailure)


def _on_demand(
    place: str,
    name: str,
    *actions: str,
    failures: tuple[type[Exception], ...] = (),
    performs: Callable[[Platform, Action], bool] | None = None,
) -> OnDemand:
    return OnDemand(f"executive.modules.{place}", name, actions, failures, performs)


def _takes_several_hands(platform: Platform, action: Action) -> bool:
    """Return whether an action is about a thing that one hand does not hold."""
    what = action.get("object_acted_on")
    name = platform.scene.bodies.known(what) if isinstance(what, Object) else None
    return name is not None and platform.scene.bodies.hands(name) > 1


ON_DEMAND = (
    _on_demand("waiting:Waiting", "waiting", "Waiting", failures=(DesignatorFailure,)),
    _on_demand(
        "containers:Containers",
        "container",
        "OpeningAContainerArtifact",
        "ClosingAContainerArtifact",
        failures=_HAND_WORK,
    ),
    _on_demand(
        "placing:Lowering",
        "lowering",
        "LoweringAnObject",
        failures=(ManipulationFailure, PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand(
        "devices:Devices",
        "device",
        "TurningOnPoweredDevice",
        "TurningOffPoweredDevice",
        "PreheatOven",
        "OperateOven",
        failures=_HAND_WORK,
    ),
    _on_demand(
        "searching:Software",
        "software",
        "StartSoftwareModules",
        "StopSoftwareModules",
        "LoadTypicalObjectModels",
        failures=(DesignatorFailure,),
    ),
    _on_demand("searching:Inference", "inference", "InferLikelyObjectLocations", failures=(DesignatorFailure,)),
    _on_demand(
        "searching:Checking",
        "checking",
        "CheckingWhetherConditionObtains",
        failures=(PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand(
        "exploring:Exploring",
        "exploration",
        "EnvironmentExploration",
        failures=(PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand(
        "constrained_motions:ConstrainedMotions",
        "constrained_motion",
        "ITaSCMotion",
        failures=(ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand(
        "setting_aside:SettingAside",
        "setting_aside",
        "SettingAsideAnObject",
        failures=(ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand("stepping_back:SteppingBack", "stepping_back", "SteppingBack", failures=(NavigationFailure,)),
    _on_demand(
        "strokes:Strokes",
        "stroke",
        "CirclingMotion",
        failures=(ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand(
        "wiping:Wiping",
        "wiping",
        "WipingMotion",
        failures=(ManipulationFailure, NavigationFailure, PerceptionFailure, LookingFailure, DesignatorFailure),
    ),
    _on_demand(
        "pushing:Pushing",
        "pushing",
        "PushingMotion",
        failures=(
            EnvironmentManipulationFailure,
            ManipulationFailure,
            NavigationFailure,
            PerceptionFailure,
            LookingFailure,
            DesignatorFailure,
            ObjectNowhereToBeFound,
        ),
    ),
    _on_demand("mapping:Mapping", "mapping", "UploadMapToRoboEarth"),
    _on_demand(
        "two_hands:TwoHands",
        "two_hands",
        "GraspingSomething",
        "PickingUpAnObject",
        "TakingSomething",
        "CarryingWhileLocomoting",
        "PuttingDownAnObject",
        "LoweringAnObject",
        "ReleasingGraspOfSomething",
        failures=(
            ManipulationFailure,
            GripperFailure,
            NavigationFailure,
            PerceptionFailure,
            LookingFailure,
            DesignatorFailure,
        ),
        performs=_takes_several_hands,
    ),
)


def bundled_registry() -> ModuleRegistry:
    """Return a registry with the process modules that come with planlang."""
    registry = ModuleRegistry()
    for module in (process_modules, perception):
        registry.add(module, "planlang", Rank.BUNDLED)
    for one in ON_DEMAND:
        registry.add_on_demand(one, "planlang", Rank.BUNDLED)
    return registry


def performed_by(files: Sequence[Path], found: list[Diagnostic]) -> frozenset[str]:
    """Return the action classes that process modules perform, those of the user's files, which are executed, too.

    Appends what is wrong with them; raises BadInput for a file that cannot be imported.
    """
    registry = bundled_registry()
    registry.add_installed()
    for file in files:
        registry.add_file(file)
    registry.resolve(found)
    return registry.actions
