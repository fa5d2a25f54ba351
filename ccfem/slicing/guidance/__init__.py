"""Guidance field: a scalar field on the part whose level surfaces are its layers."""

from ccfem.slicing.guidance.joints import Joint, joint_of
from ccfem.slicing.guidance.scalar_guidance import (
    FieldQuality,
    GuidanceField,
    Weights,
    field_quality,
    guidance_field,
)

__all__ = [
    "FieldQuality",
    "GuidanceField",
    "Joint",
    "Weights",
    "field_quality",
    "guidance_field",
    "joint_of",
]
