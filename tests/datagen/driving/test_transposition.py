"""Irradiance on a plane while the sun is at the horizon or below, by hand."""

import numpy as np

from datagen.driving.transposition import SunPosition, sunlit_middle, transposed


def test_the_middle_of_the_sunlit_part_of_a_span():
    """Height rises from -1 to 3 degree: lit from a quarter of the span on; falls from 1 to -4: lit up to a fifth."""
    heights = np.array([-1.0, 3.0, 5.0, 1.0, -4.0, -6.0])
    np.testing.assert_allclose(sunlit_middle(heights), [0.625, 0.5, 0.5, 0.1, 0.5])


def test_after_sunset_a_plane_gets_the_diffuse_light_of_its_part_of_the_sky():
    """At 60 degree it sees three quarters of the sky and a quarter of the ground: 10 * 0.75 + 20 * 0.2 * 0.25."""
    sun = SunPosition(zenith=np.array([91.0, 96.0]), azimuth=np.array([310.0, 320.0]))
    for model in ("perez", "isotropic"):
        found = transposed(
            np.array([152, 152]),
            sun,
            dni=np.zeros(2),
            dhi=np.array([10.0, 0.0]),
            ghi=np.array([20.0, 0.0]),
            tilt=60.0,
            azimuth=180.0,
            albedo=0.2,
            model=model,
        )
        np.testing.assert_allclose(found, [8.5, 0.0], atol=1e-9)
