"""A fit as InferenceData: ArviZ's own functions work on it, and a file of it is still a run's."""

import math
import warnings
from dataclasses import replace
from pathlib import Path

import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest
import yaml

from galileo_jax.assembly.build_problem import make_joint_problem
from galileo_jax.clip.load import load_clip
from galileo_jax.clip.track_csv import write_observation_csv
from galileo_jax.inference.convergence import arviz
from galileo_jax.inference.fit_posterior import fit_posterior, laplace_posterior
from galileo_jax.inference.fits.gradient import GradientFit, GradientFitter
from galileo_jax.inference.joint_problem import JointProblem
from galileo_jax.inference.posterior import Posterior, Status
from galileo_jax.measurement.measure import measure
from galileo_jax.observation.observation import Observation
from galileo_jax.results import inference_data as module
from galileo_jax.results.inference_data import inference_data
from galileo_jax.search.fit import best_fit
from tests.precision import in_64_bit

FRAMES, HIDDEN, NOISE_M, K1 = 40, 7, 1e-3, 0.3
GROUPS = {
    "posterior", "sample_stats", "prior", "posterior_predictive", "log_likelihood",
    "observed_data",
}  # fmt: skip


@pytest.fixture(autouse=True, scope="module")
def precision():
    with in_64_bit():
        yield


def write_incline(folder: Path) -> Path:
    """A box slides; one frame does not show it."""
    angle, up = math.radians(22), 0.03
    times = np.arange(FRAMES) / 60
    along = 0.5 * 9.81 * (math.sin(angle) - K1 * math.cos(angle)) * times**2 - 1.0
    place = np.stack([along * math.cos(angle) + up * math.sin(angle),
                      -along * math.sin(angle) + up * math.cos(angle)])[None]  # fmt: skip
    place = place + NOISE_M * np.random.default_rng(1).standard_normal(place.shape)
    mask = np.ones((1, FRAMES), bool)
    mask[0, HIDDEN] = False
    place[:, :, HIDDEN] = np.nan
    covariance = np.where(mask[:, None, None], NOISE_M**2 * np.eye(2)[None, :, :, None], np.nan)
    write_observation_csv(
        folder / "clip.csv", Observation(("object1",), times, place, covariance, mask)
    )
    content = {
        "track": "clip.csv",
        "scenario": "incline",
        "ramp_angle_deg": 22.0,
        "objects": [{"name": "object1", "shape": "box", "size_m": [0.06, 0.06, 0.06]}],
    }
    (folder / "clip.yaml").write_text(yaml.safe_dump(content))
    return folder / "clip.yaml"


@pytest.fixture(scope="module")
def trials(tmp_path_factory) -> JointProblem:
    one = measure(load_clip(write_incline(tmp_path_factory.mktemp("incline"))))
    return make_joint_problem([one.clip], [one.observation])


@pytest.fixture(scope="module")
def fit(trials) -> GradientFit:
    return best_fit(GradientFitter(trials), 0)


@pytest.fixture(scope="module")
def fitted(trials, fit) -> tuple[JointProblem, Posterior]:
    return trials, laplace_posterior(trials, fit, 0)


@pytest.fixture(scope="module")
def data(fitted):
    return inference_data(*fitted)


def test_groups_sizes_and_units(fitted, data):
    trials, posterior = fitted
    assert set(data.groups()) == GROUPS
    count = 2 * (FRAMES - 1)
    assert data.observed_data.position.shape == (count,)
    assert data.posterior_predictive.position.shape == (1, module.NUM_PREDICTIVE_DRAWS, count)
    assert data.log_likelihood.position.shape == (1, module.NUM_LIKELIHOOD_DRAWS, count)
    assert data.prior.k1.shape == (1, module.NUM_PRIOR_DRAWS)
    for group in GROUPS - {"sample_stats"}:
        assert all("units" in values.attrs for values in data[group].data_vars.values()), group
        assert not any(values.isnull().any() for values in data[group].data_vars.values()), group
    assert set(data.prior.data_vars) == set(trials.names) == set(data.posterior.data_vars)
    np.testing.assert_array_equal(data.posterior.k1.values, posterior["k1"])


def test_coordinates_say_what_is_what(fitted, data):
    observed, seen = data.observed_data.position, fitted[0].problems[0].observation
    for i in range(observed.size):
        one = observed[i]
        axis = ("x", "y").index(str(one.coords["axis"].values))
        frame = int(one.coords["frame"])
        assert str(one.coords["object"].values) == "object1"
        assert str(one.coords["clip"].values) == "clip"
        assert float(one) == seen.position_m[0, axis, frame]
        assert float(one.coords["time_s"]) == seen.times_s[frame]
    assert HIDDEN not in observed.frame


def test_the_prior_is_the_models(data):
    k1 = data.prior.k1.values.reshape(-1)  # uniform from 0 to 1
    assert k1.min() >= 0 and k1.max() <= 1
    assert k1.mean() == pytest.approx(0.5, abs=0.04)
    assert k1.std() == pytest.approx(12**-0.5, abs=0.02)


def test_the_predictive_contains_what_was_measured(data):
    """Within the noise's 95 %, and with no more of it than the model has."""
    low, high = np.quantile(data.posterior_predictive.position, [0.025, 0.975], axis=(0, 1))
    observed = data.observed_data.position.values
    assert ((low < observed) & (observed < high)).mean() > 0.9
    assert (high - low).max() < 0.2


def test_summary(data):
    table = arviz().summary(data, var_names=["k1"])
    assert table.loc["k1", "mean"] == pytest.approx(K1, abs=0.02)


def test_loo_prefers_the_model_that_fits(fitted, data):
    """Finite, with good weights, and far better than that of a wrong friction."""
    az = arviz()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of weights that are judged below
        loo = az.loo(data, pointwise=True)
    assert np.isfinite(loo.elpd_loo)
    assert float(loo.pareto_k.max()) < 0.7
    trials, posterior = fitted
    draws = posterior.draws.copy()
    draws[..., trials.names.index("k1")] += 0.05
    wrong = inference_data(trials, replace(posterior, draws=draws))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of its weights
        worse = az.loo(wrong)
    assert worse.elpd_loo < loo.elpd_loo - 10


def test_draws_that_were_weighed_before_are_not_weighed_again(trials, fit):
    """Their weights are known no more; what they are worth is."""
    posterior = fit_posterior(trials, fit, 0)
    found = inference_data(trials, posterior)["log_likelihood"]["position"].attrs
    assert float(found["importance_ess"]) == pytest.approx(posterior.provenance["ess"], rel=0.01)
    assert "importance_pareto_k" not in found


def test_draws_of_a_poor_approximation_are_weighted(trials, fit, fitted):
    """Drawn again, those of one twice as wide are the posterior's; and `az.loo` finds the same."""
    _, posterior = fitted
    wide = laplace_posterior(trials, replace(fit, covariance=4 * fit.covariance), 0)
    again, pareto_k = module._drawn_again(trials, wide, np.random.default_rng(0))
    assert pareto_k < 0.7
    k1 = trials.names.index("k1")
    assert wide["k1"].std() > 1.8 * posterior["k1"].std()
    assert again[:, k1].std() == pytest.approx(posterior["k1"].std(), rel=0.15)
    assert again[:, k1].mean() == pytest.approx(posterior["k1"].mean(), abs=posterior["k1"].std())
    az = arviz()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of its weights
        found = [az.loo(inference_data(trials, one)).elpd_loo for one in (posterior, wide)]
    assert found[0] == pytest.approx(found[1], abs=0.5)


@pytest.mark.filterwarnings("ignore:Passing a dict or None:DeprecationWarning")
def test_plot_ppc(data):
    matplotlib.use("Agg")
    axes = arviz().plot_ppc(data, num_pp_samples=20, random_seed=0)
    assert len(np.atleast_1d(axes).ravel()[0].lines) >= 3
    plt.close("all")


def test_files_of_it_are_read_as_a_posterior(fitted, data, tmp_path):
    _, posterior = fitted
    data.to_netcdf(str(tmp_path / "all.nc"), engine="h5netcdf")
    posterior.to_netcdf(tmp_path / "posterior.nc")
    for name in ("all.nc", "posterior.nc"):
        back = Posterior.from_netcdf(tmp_path / name)
        assert back.names == posterior.names
        np.testing.assert_array_equal(back.draws, posterior.draws)
        np.testing.assert_array_equal(back.log_density, posterior.log_density)
        assert back.status is posterior.status
    again = arviz().from_netcdf(str(tmp_path / "all.nc"), engine="h5netcdf")
    assert list(again.observed_data.axis.values) == list(data.observed_data.axis.values)


def test_several_clips_and_chains(fitted):
    """Each clip's numbers stand under its name, and have its own noise scale."""
    problem = fitted[0].problems[0]
    trials = JointProblem((problem, replace(problem, name="other")))
    median = dict(zip(fitted[0].names, np.median(fitted[1].flat(), axis=0), strict=True))
    theta = [median[name.removesuffix("_1").removesuffix("_2")] for name in trials.names]
    theta[-1] = theta[-2] * np.exp(0.6)  # the second clip's noise is larger
    draws = np.tile(theta, (2, 30, 1))
    posterior = Posterior(trials.names, draws, np.zeros((2, 30)), Status.CONVERGED)
    found = inference_data(trials, posterior)
    like = found["log_likelihood"].position
    count = 2 * (FRAMES - 1)
    assert list(like["clip"].values) == ["clip"] * count + ["other"] * count
    assert like.shape == (2, 30, 2 * count)
    first, second = (like.values[0, 0, like["clip"].values == name] for name in ("clip", "other"))
    assert np.median(first - second) == pytest.approx(0.6, abs=0.35)


def test_of_other_parameters(fitted):
    trials, posterior = fitted
    other = replace(posterior, names=("a", *posterior.names[1:]))
    with pytest.raises(ValueError, match=r"posterior of .*'a'"):
        inference_data(trials, other)
