"""What a study asks for of its solved points beside the usual numbers (`data.on_request`)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tcstudy.data.on_request import variables
from tcstudy.data.records import BlockRecord, PointStatus
from tcstudy.offline.level import Level
from tcstudy.offline.requested import Requested
from tcstudy.scene.study import Study


def with_requested(study: Study, level: Level, record: BlockRecord) -> BlockRecord:
    """The block with the numbers and the derivatives that the study asks for."""
    if study.output.probes or study.output.quantities:
        names = [v.name for v in variables(replace(study, output=replace(study.output, sensitivity=())))]
        columns = {name: np.full(len(record), np.nan) for name in names}
        asked = Requested(level, study.output)
        for row, place in enumerate(record.points):
            if record.status[row] == PointStatus.OK and record.u_T is not None:
                for name, value in asked.of(study.scenes[int(place)], record.u_T[row]).items():
                    columns[name][row] = value
        record = replace(record, numbers={**record.numbers, **columns})
    if study.output.sensitivity:
        from tcstudy.study.sensitivities import with_sensitivities  # only for a study that asks for them

        record = with_sensitivities(study, level, record)
    return record
