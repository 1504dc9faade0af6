"""The tests that a mutant of a folder must pass: its unit tests, then the nearest wider ones. Names with a capital letter are those of
ctest, the others are programs of gtest. The golden recording is not among them: it notices every change of a bit, right or wrong. A mutant that they leave alive meets the tests of the other
folders that come past it."""
NEAREST = {
    "server": ("daemon_test", "Fault_injected", "Attack_process", "Attack_budgets", "Attack_trust", "CommandLine"),
    "server/aggregate": ("aggregate_test", "step_test"),
    "server/base": ("base_test", "wire_test", "step_test"),
    "server/bound": ("bound_test", "step_test"),
    "server/gate": ("gate_test", "service_test", "Attack_transport", "Attack_trust"),
    "server/gl": ("gl_test", "egl_test"),
    "server/metrics": ("Metrics",),
    "server/move": ("move_test", "step_test"),
    "server/record": ("mcap_test", "recorder_test", "session_snapshot_test", "recording_daemon_test"),
    "server/rpc": ("service_test",),
    "server/sample": ("extent_test", "cull_test", "embree_test", "egl_test", "step_test"),
    "server/scene": ("scene_test", "gltf_test", "packed_test", "session_test"),
    "server/schedule": ("schedule_test", "service_test"),
    "server/service": ("service_test", "daemon_test", "recording_daemon_test", "Attack_trust", "Attack_budgets"),
    "server/session": ("session_test", "session_snapshot_test", "wire_test"),
    "server/settings": ("wire_test", "session_test"),
    "server/step": ("step_test", "session_test", "wire_test"),
    "server/wire": ("wire_test", "service_test"),
    "client/base": ("client_unit_test", "recording_test", "CommandLine", "CommandJson", "bench_load_test"),
    "client/bench": ("bench_test", "bench_load_test"),
    "client/ceiling": ("ceiling_test",),
    "client/command": ("gltf_test", "packed_test", "CommandLine", "CommandJson"),
    "client/cpp": ("client_test", "client_unit_test"),
    "client/demo": ("Demo",),
    "client/drive": ("drive_test", "comparison_test", "CommandJson"),
    "client/evaluate": ("evaluate_test", "CommandJson"),
    "client/page": ("session_page_test", "recording_page_test", "drive_test"),
    "client/recordings": ("recording_test", "recording_verbs_test", "random_cuts_test", "conformance_test", "damaged_messages_test", "CommandJson"),
    "client/replay": ("compare_test", "replay_test", "replay_server_test", "CommandJson"),
    "client/report": ("recording_page_test", "CommandJson"),
    "client/scenario": ("client_unit_test", "scenes_test", "drive_test"),
    "client/status": ("status_test", "CommandLine", "CommandJson", "Metrics"),
    "client/truth": ("client_unit_test", "evaluate_test"),
}


def is_program(name):
    return name[0].islower()
