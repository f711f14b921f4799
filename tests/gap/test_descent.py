def test_a_widely_stepped_rig_can_be_changed_as_any_other() -> None:
    key = "controls.column.loader.friction_N"
    assert widely_stepped(RIG).changed({key: 2.0}) == widely_stepped(RIG.changed({key: 2.0}))
