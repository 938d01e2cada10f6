# SPDX-License-Identifier: GPL-3.0-or-later
"""The look of a cloud: exposure, tint, saturation, opacity, without a change of its splats."""

from ctypes import byref, c_double
from dataclasses import dataclass

from .cloud import Cloud
from .errors import check
from .handle import new_handle
from .structs import StippleGrade, StippleGradeSettings


@dataclass(frozen=True)
class GradeSettings:
    exposure: float = 0.0           # stops
    tint: tuple = (1.0, 1.0, 1.0)   # factors of the light
    saturation: float = 1.0         # 0: grey
    opacity: float = 1.0            # factor

    @property
    def is_neutral(self):
        return self == GradeSettings()


def native_grade(library, settings, colour_space):
    """The StippleGrade of settings, for colours stored in that space. Errors: StippleError."""
    given = StippleGradeSettings(exposure=settings.exposure, tint=(c_double * 3)(*settings.tint),
                                 saturation=settings.saturation, opacity=settings.opacity)
    grade = StippleGrade()
    check(library, library.stipple_grade_from_settings(byref(given), int(colour_space), byref(grade)))
    return grade


class GradedCloud:
    """A cloud as its object grades it, wherever a Cloud is drawn, joined, read or written; the cloud itself stays."""

    def __init__(self, cloud, settings):
        self.cloud = cloud
        self.settings = settings
        self.grade = native_grade(cloud.library, settings, cloud.info().colour_space)

    @property
    def library(self):
        return self.cloud.library

    @property
    def pointer(self):
        return self.cloud.pointer

    def info(self):
        return self.cloud.info()

    def baked(self):
        """A cloud with the grade in its harmonics and opacities."""
        return Cloud(self.library, new_handle(self.library, 'stipple_cloud_grade', self.pointer, byref(self.grade)))

    def read(self):
        return self.baked().read()

    def columns(self):
        return self.baked().columns()

    def save(self, path, **options_given):
        self.baked().save(path, **options_given)

    def transformed(self, matrix):
        return self.baked().transformed(matrix)

    def compare(self, other):
        return self.baked().compare(other)


def graded(cloud, settings):
    """The cloud with a grade; the cloud itself where that changes nothing. Errors: StippleError."""
    return cloud if settings.is_neutral else GradedCloud(cloud, settings)
