"""The dataset card: a README in every dataset that says what is in it and how to read it."""

from __future__ import annotations

from pathlib import Path

from jinja2 import Environment, StrictUndefined

from datagen.farming.versions import in_words
from shared.numbers import counted
from shared.schema import EPOCH, SPLITS, split_of
from shared.store import Manifest, write_atomically
from shared.system import System

_CARD = """\
# {{ system.name }}: {{ done | counted("simulated system") }}

{{ system.description }}.

{{ done }} of {{ manifest.systems | counted("system") }}, {{ hours }} h each in steps of {{ step }} s, root seed
{{ seeds }}, in {{ manifest.shards | length | counted("shard") }}. Time is
{%- if roams %} in seconds from the beginning of each record, `start`, which is a date in local standard time;
{%- else %} local standard time, in seconds since {{ epoch }};
{%- endif %} a value belongs to the step that ends at its time.
{%- if not manifest.settings.excitation %} Excitation was switched off.{% endif %}
{%- if 'calm' in manifest.settings %} A share of
{{ manifest.settings.calm }} of the systems, drawn by chance, had no excitation.{% endif %}
{%- if 'uncertain' in manifest.settings %} The uncertain
constants of the description were drawn for each system.{% endif %}

| split | systems |
|---|---|
{% for name, count in splits %}| {{ name }} | {{ count }} |
{% endfor %}
| variable | role | unit | what |
|---|---|---|---|
{% for p in system.parameters %}| `{{ p.name }}` | parameter | {{ p.unit }} | {{ p.description }}, \
{{ p.scale }} from {{ p.min }} to {{ p.max }} |
{% endfor -%}
{% for c in system.uncertain if 'uncertain' in manifest.settings %}| `{{ c.name }}` | constant | 1 |\
 {{ c.description }}, as a multiple of its value: exp({{ c.relative }} N(0, 1)) |
{% endfor -%}
{% for o in system.outputs %}| `{{ o.name }}` | output | {{ o.unit }} | {{ o.long_name }} ({{ o.method }}) |
{% endfor -%}
{% for i in system.inputs %}| `{{ i.name }}` | input | {{ i.unit }} | from {{ i.source }} |
{% endfor %}
Read it with plain xarray:

```python
from pathlib import Path
{%- if roams %}
import numpy as np
{%- endif %}
import xarray as xr

shards = sorted(Path("shards").glob("*.nc"))
parts = [xr.load_dataset(shard{% if roams %}, decode_times=False{% endif %}) for shard in shards]
{%- if manifest.sources %}
parts = [part.assign_coords(root_seed=("system", [part.attrs["root_seed"]] * part.sizes["system"])) for part in parts]
{%- endif %}
data = xr.concat(parts, dim="system", data_vars="minimal")
train = data.isel(system=(data["split"] == 0).values)
{%- if roams %}
date = np.datetime64("{{ epoch[:10] }}") + (data["start"] + data["time"]).astype("timedelta64[s]")  # of each value
{%- endif %}
```

{% if manifest.sources %}The dataset was merged: a system is known by its shard's `root_seed` and its index.

{% endif %}{% if manifest.other_versions %}Several versions made it, whose systems agree within the solver's tolerance,
not bit for bit:

{% for one in versions %}- {{ one }}
{% endfor %}
{% endif %}`manifest.json` lists every shard with its hashes; `datagen verify` holds the files against it.
System {{ manifest.system_hash[:16] }}, FMU {{ manifest.fmu_sha256[:16] }}, schema {{ manifest.schema_version }}.
"""


def write_card(folder: Path, manifest: Manifest, system: System) -> None:
    """Write the dataset's ``README.md``."""
    done = manifest.done()
    splits = [split_of(seed, index) for seed, index in done]
    seeds = [source.root_seed for source in manifest.sources] or [manifest.root_seed]
    environment = Environment(undefined=StrictUndefined, autoescape=False, keep_trailing_newline=True)
    environment.filters["counted"] = counted
    text = environment.from_string(_CARD).render(
        system=system,
        manifest=manifest,
        done=len(done),
        seeds=", ".join(map(str, seeds)),
        hours=f"{system.experiment.hours:g}",
        step=f"{system.experiment.step:g}",
        epoch=EPOCH,
        roams=system.experiment.start[1] > 0,
        versions=in_words(manifest),
        splits=[(name, splits.count(k)) for k, name in enumerate(SPLITS)],
    )
    write_atomically(folder / "README.md", text.encode())
