"""The steps from logs to results, as functions of data: every front end calls these and contains no estimation."""

from fifthwheel.identify.given import require_signals
from fifthwheel.identify.knowledge.storage import file_of as knowledge_file
from fifthwheel.options import IdentifyOptions
from fifthwheel.time_bases import check_signals
from fifthwheel.time_bases.evidence import ChannelEvidence, SignalEvidence, signal_evidence
from fifthwheel.workflow.exported import exported_learner, exported_observer
from fifthwheel.workflow.identification import design_run, run_identification, run_loads
from fifthwheel.workflow.inputs import (
    identification_file,
    read_knowledge,
    read_records,
    read_vehicle,
    vehicle_and_identification,
    vehicle_file,
    vehicle_text,
)
from fifthwheel.workflow.log_contents import propose_signals, survey_file
from fifthwheel.workflow.measured_vehicle import (
    axle_load_differences,
    changed_numbers,
    drive_vehicle,
    roll_tested_vehicle,
    weigh_by_slip,
    weigh_vehicle,
)
from fifthwheel.workflow.results import (
    ASSESSMENT_FILES,
    EVALUATION_FILES,
    IDENTIFICATION_FILES,
    STATES_FILES,
    VALIDATION_FILES,
    compare_runs,
    read_truck,
    write_assessment,
    write_comparison,
    write_evaluation,
    write_loads,
    write_results,
)
from fifthwheel.workflow.settings import chosen_one_stage, identification_settings
from fifthwheel.workflow.start import starts_of
from fifthwheel.workflow.states import run_states

__all__ = [
    "ASSESSMENT_FILES",
    "EVALUATION_FILES",
    "IDENTIFICATION_FILES",
    "STATES_FILES",
    "VALIDATION_FILES",
    "ChannelEvidence",
    "IdentifyOptions",
    "SignalEvidence",
    "axle_load_differences",
    "changed_numbers",
    "check_signals",
    "chosen_one_stage",
    "compare_runs",
    "design_run",
    "drive_vehicle",
    "exported_learner",
    "exported_observer",
    "identification_file",
    "identification_settings",
    "knowledge_file",
    "propose_signals",
    "read_knowledge",
    "read_records",
    "read_truck",
    "read_vehicle",
    "require_signals",
    "roll_tested_vehicle",
    "run_identification",
    "run_loads",
    "run_states",
    "signal_evidence",
    "starts_of",
    "survey_file",
    "vehicle_and_identification",
    "vehicle_file",
    "vehicle_text",
    "weigh_by_slip",
    "weigh_vehicle",
    "write_assessment",
    "write_comparison",
    "write_evaluation",
    "write_loads",
    "write_results",
]
