"""The flow against a posterior that is known, its running-mean weights, and its temperatures."""

import math

import numpy as np
import pytest
import torch

from trainer.posterior.conditions import Contexts
from trainer.posterior.fitting import train_flow
from trainer.posterior.flow import PosteriorFlow
from trainer.posterior.inference import summarise
from trainer.posterior.prior import Prior
from trainer.posterior.tempering import temper

from ..conftest import TANK, tank_system

MIXING = torch.tensor([[1.0, 0.5], [0.2, 1.0]])
NOISE = 0.4


def gaussian_windows(count, seed):
    """Standard normal parameters z behind readings x = M z + noise: the posterior is Gaussian (Bishop, 2006, 2.3.3)."""
    generator = torch.Generator().manual_seed(seed)
    z = torch.randn(count, 2, generator=generator)
    x = z @ MIXING.T + NOISE * torch.randn(count, 2, generator=generator)
    covariance = torch.linalg.inv(torch.eye(2) + MIXING.T @ MIXING / NOISE**2)
    mean = x @ MIXING / NOISE**2 @ covariance
    none = torch.zeros(count, dtype=torch.int64)
    return Contexts(torch.cat([x, x], dim=1), z, none, torch.arange(count)), mean, covariance


@pytest.fixture(scope="module")
def gaussian_flow():
    torch.set_num_threads(1)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        held_out = gaussian_windows(1000, 1)[0]
        flow, facts = train_flow(gaussian_windows(3000, 0)[0], held_out, 1, 0, 15, {"width": 32, "splines": 2})
    temper(flow, held_out, seed=0)
    return flow, facts


@pytest.mark.slow
def test_the_flow_finds_a_known_posterior(gaussian_flow):
    flow, facts = gaussian_flow
    windows, mean, covariance = gaussian_windows(1000, 2)
    base = torch.randn(1000, 200, 2, generator=torch.Generator().manual_seed(3))
    with torch.no_grad():
        samples = flow.sample(windows.context, base)
    sd = covariance.diag().sqrt()
    assert ((samples.mean(dim=1) - mean) / sd).pow(2).mean().sqrt() < 0.2
    spread = samples.std(dim=1).mean(dim=0) / sd
    assert torch.all((spread - 1).abs() < 0.1)
    correlation = summarise(samples.double().numpy()).correlation[:, 0, 1].mean()
    assert correlation == pytest.approx((covariance[0, 1] / sd.prod()).item(), abs=0.06)
    low, high = torch.quantile(samples, torch.tensor([0.05, 0.95]), dim=1)
    inside = ((windows.z > low) & (windows.z < high)).float().mean(dim=0)
    assert torch.all((inside - 0.9).abs() < 0.045)  # 3.6 standard errors of this share and of the temperature
    # information gained: half the log determinant of the prior's covariance over the posterior's
    assert facts["gain"] == pytest.approx(-0.5 * torch.logdet(covariance).item(), abs=0.08)
    exact = torch.distributions.MultivariateNormal(mean, covariance).log_prob(windows.z)
    with torch.no_grad():
        assert flow.log_prob(windows.context, windows.z[:, None]).mean() == pytest.approx(exact.mean().item(), abs=0.08)


@pytest.mark.slow
def test_temperatures_widen_a_flow_that_is_too_sure(gaussian_flow):
    """Truths twice as far from the centre as the flow thinks need twice the width."""
    flow, _ = gaussian_flow
    before = flow.log_temperature.clone()
    windows, mean, _ = gaussian_windows(800, 4)
    temper(flow, windows._replace(z=mean + 2 * (windows.z - mean)), seed=0)
    assert flow.log_temperature.exp().numpy() == pytest.approx(2 * before.exp().numpy(), rel=0.15)
    with torch.no_grad():
        centre = flow.centre(windows.context)
        samples = flow.sample(windows.context, torch.randn(800, 30, 2))
        flow.log_temperature.zero_()
        narrow = flow.sample(windows.context, torch.randn(800, 30, 2))
    flow.log_temperature.copy_(before)
    ratio = (samples - centre[:, None]).pow(2).mean().sqrt() / (narrow - centre[:, None]).pow(2).mean().sqrt()
    assert ratio == pytest.approx(2.05, abs=0.25)


def test_windows_that_lack_an_output_have_temperatures_of_their_own():
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        flow = PosteriorFlow(2, 5, lengths=1, outputs=1, width=32, splines=2).eval()
        context = torch.randn(2000, 5)
        context[:, -1] = torch.arange(2000) % 2  # the share of the output that is missing
        with torch.no_grad():
            centre, drawn = flow.centre(context), flow.sample(context, torch.randn(2000, 1, 2))[:, 0]
    lacking = flow.lacking(context)
    assert lacking.tolist() == 1000 * [0, 1]
    z = centre + (1 + lacking[:, None]) * (drawn - centre)
    temper(flow, Contexts(context, z, torch.zeros(2000, dtype=torch.int64), torch.arange(2000)), seed=0)
    assert flow.log_temperature.exp().numpy() == pytest.approx(np.array([[[1.0, 1.0], [2.0, 2.0]]]), rel=0.12)


def test_a_range_through_zero_is_linear_beside_a_logarithmic_one():
    system = tank_system(TANK.replace("min = 2.0\nmax = 20.0", "min = -3.0\nmax = 1.0"))
    prior = Prior.of(system)
    at = np.array([[-1.0, 2.0], [0.0, 1.0], [0.5, 4.0]])
    assert prior.to_unit(at) == pytest.approx(np.array([[0.5, 0.5], [0.75, 0.0], [0.875, 1.0]]))
    assert prior.from_normal(prior.to_normal(at)) == pytest.approx(at, abs=1e-6)
    assert prior.log_density(at) == pytest.approx(-math.log(4) - np.log(at[:, 1] * math.log(4)))


def test_the_prior_is_standard_normal():
    prior = Prior.of(tank_system())
    assert prior.log.tolist() == [False, True]
    assert prior.to_normal(np.array([[11.0, 2.0]])) == pytest.approx(np.zeros((1, 2)), abs=1e-12)
    drain = 2 + 18 * 0.975
    assert prior.to_normal(np.array([[drain, 4**0.025]])) == pytest.approx(np.array([[1.96, -1.96]]), abs=1e-3)
    extremes = prior.from_normal(np.array([[-40.0, 40.0], [40.0, -40.0]]))
    assert extremes == pytest.approx(np.array([[2.0, 4.0], [20.0, 1.0]]))
    assert prior.inside(extremes).all()
    assert not prior.inside(np.array([[1.99, 2.0]])).any()
    # density of a logarithmic parameter: 1 / (p log(max / min))
    assert prior.log_density(np.array([11.0, 2.0])) == pytest.approx(-math.log(18) - math.log(2 * math.log(4)))
    # of standard normal numbers it is the Jacobian times the normal density
    at = np.array([5.0, 1.3])
    normal = -0.5 * (prior.to_normal(at) ** 2).sum() - math.log(2 * math.pi)
    assert prior.log_jacobian(at) + normal == pytest.approx(prior.log_density(at))
