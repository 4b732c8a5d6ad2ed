"""modelDescription.xml and the C tables of the default FMU, rendered from its variables table."""

from __future__ import annotations

from xml.sax.saxutils import quoteattr

from fmus.tables import Table, Variable, source_files

_CAUSALITY = {
    "input": ("input", "continuous", None),
    "output": ("output", "continuous", "calculated"),
    "local": ("local", "continuous", "calculated"),
    "parameter": ("parameter", "fixed", "exact"),
    "boolean": ("parameter", "fixed", "exact"),
    "state": ("local", "continuous", "calculated"),
    "derivative": ("local", "continuous", "calculated"),
}
GENERATED = ("variables.c", "variables.h")


def render_model_description(table: Table) -> str:
    """The modelDescription.xml of the FMU (FMI 2.0, Model Exchange)."""
    index = {v.name: i for i, v in enumerate(table.variables, start=1)}
    sources = [p.name for p in source_files() if p.suffix == ".c"]
    sources = sorted([*sources, "variables.c"])
    lines = [
        '<?xml version="1.0" encoding="UTF-8"?>',
        f'<fmiModelDescription fmiVersion="2.0" modelName="{table.identifier}" guid="{table.guid}"',
        f"  description={quoteattr(table.description)} version={quoteattr(table.source_hash[:12])}",
        f'  generationTool="fmus/build.py" variableNamingConvention="structured"'
        f' numberOfEventIndicators="{table.event_indicators}">',
        f'  <ModelExchange modelIdentifier="{table.identifier}" completedIntegratorStepNotNeeded="true"',
        '    canGetAndSetFMUstate="true" canSerializeFMUstate="true" providesDirectionalDerivative="true">',
        "    <SourceFiles>",
        *[f'      <File name="{name}"/>' for name in sources],
        "    </SourceFiles>",
        "  </ModelExchange>",
        "  <UnitDefinitions>",
        *[line for name, unit in table.units.items() for line in _unit(name, unit)],
        "  </UnitDefinitions>",
        "  <LogCategories>",
        *[f'    <Category name="{name}"/>' for name in ("logAll", "logStatusDiscard", "logStatusError")],
        "  </LogCategories>",
        '  <DefaultExperiment startTime="0" stopTime="86400" tolerance="1e-6"/>',
        "  <ModelVariables>",
        *[line for v in table.variables for line in _variable(v, index)],
        "  </ModelVariables>",
        "  <ModelStructure>",
    ]
    outputs, states, derivatives = (table.kind(k) for k in ("output", "state", "derivative"))
    groups = {"Outputs": outputs, "Derivatives": derivatives}
    groups["InitialUnknowns"] = sorted(outputs + states + derivatives, key=lambda v: index[v.name])
    for tag, unknowns in groups.items():
        lines.append(f"    <{tag}>")
        lines += [f'      <Unknown index="{index[v.name]}"/>' for v in unknowns]
        lines.append(f"    </{tag}>")
    lines += ["  </ModelStructure>", "</fmiModelDescription>", ""]
    return "\n".join(lines)


def _unit(name: str, unit: dict[str, object]) -> list[str]:
    exponents = "".join(f' {k}="{v}"' for k, v in unit.items() if k != "display")
    lines = [f"    <Unit name={quoteattr(name)}>", f"      <BaseUnit{exponents}/>"]
    displays = unit.get("display", {})
    assert isinstance(displays, dict)
    lines += [f'      <DisplayUnit name="{k}" factor="1" offset="{v}"/>' for k, v in displays.items()]
    return [*lines, "    </Unit>"]


def _variable(v: Variable, index: dict[str, int]) -> list[str]:
    causality, variability, initial = _CAUSALITY[v.kind]
    head = f'    <ScalarVariable name="{v.name}" valueReference="{v.vr}" causality="{causality}"'
    head += f' variability="{variability}"'
    if initial:
        head += f' initial="{initial}"'
    head += f" description={quoteattr(v.description)}>"
    if v.kind == "boolean":
        return [head, f'      <Boolean start="{str(v.start).lower()}"/>', "    </ScalarVariable>"]
    real = f"      <Real unit={quoteattr(v.unit or '1')}"
    if v.display:
        real += f' displayUnit="{v.display}"'
    for key, value in (("min", v.low), ("max", v.high), ("nominal", v.nominal), ("start", v.start)):
        if value is not None:
            real += f' {key}="{float(value)!r}"'
    if v.kind == "derivative":
        real += f' derivative="{index[v.name[4:-1]]}"'
    return [head, real + "/>", "    </ScalarVariable>"]


def render_header(table: Table) -> str:
    """variables.h: value references and sizes."""
    real = [v for v in table.variables if v.kind != "boolean"]
    groups = {k: table.kind(k) for k in ("input", "parameter", "state", "derivative")}
    enum = [f"    {'D' if v.kind == 'derivative' else 'V'}_{v.base} = {v.vr}," for v in real if v.first]
    return "\n".join(
        [
            "/* Rendered from variables.toml by fmus/build.py. */",
            "#ifndef VARIABLES_H",
            "#define VARIABLES_H",
            "",
            f'#define MODEL_GUID "{table.guid}"',
            "",
            "/* Sizes. */",
            "enum {",
            f"    N_NODES = {table.nodes},",
            f"    N_LAYERS = {table.layers},",
            f"    N_EVENTS = {table.event_indicators},",
            f"    N_REAL = {len(real)},",
            f"    N_INPUTS = {len(groups['input'])},",
            f"    N_PARAMETERS = {len(groups['parameter'])},",
            f"    N_STATES = {len(groups['state'])},",
            f"    N_LIMITS = {len(groups['parameter'])}",
            "};",
            "",
            "/* Value references: V_ variables (the first element of an array), D_ derivatives, B_ Booleans. */",
            "enum {",
            *enum,
            *[f"    V_FIRST_{k.upper()} = {group[0].vr}," for k, group in groups.items()],
            *[f"    B_{v.base} = {v.vr}," for v in table.kind("boolean")],
            "    N_BOOLEAN",
            "};",
            "",
            "/* What a parameter may be. */",
            "typedef struct {",
            "    unsigned vr;",
            "    double low, high;",
            "    int low_open, high_open; /* whether the bound itself is excluded */",
            "} VariableLimit;",
            "",
            "extern const VariableLimit VARIABLE_LIMITS[N_LIMITS];",
            "extern const double VARIABLE_STARTS[N_REAL];",
            "extern const char *const VARIABLE_NAMES[N_REAL];",
            "extern const double STATE_NOMINALS[N_STATES];",
            "extern const int BOOLEAN_STARTS[N_BOOLEAN];",
            "",
            "#endif",
            "",
        ]
    )


def render_tables(table: Table) -> str:
    """variables.c: names, start values, limits and nominal values."""
    real = [v for v in table.variables if v.kind != "boolean"]
    limits = [
        f"    {{{v.vr}, {_bound(v.low, '-INFINITY')}, {_bound(v.high, 'INFINITY')},"
        f" {int(v.low_open)}, {int(v.high_open)}}},"
        for v in table.kind("parameter")
    ]
    return "\n".join(
        [
            "/* Rendered from variables.toml by fmus/build.py. */",
            '#include "variables.h"',
            "",
            "#include <math.h>",
            "",
            "const VariableLimit VARIABLE_LIMITS[N_LIMITS] = {",
            *limits,
            "};",
            "",
            "const double VARIABLE_STARTS[N_REAL] = {",
            *[f"    {float(v.start or 0.0)!r}, /* {v.name} [{v.unit}] */" for v in real],
            "};",
            "",
            "const char *const VARIABLE_NAMES[N_REAL] = {",
            *[f'    "{v.name}",' for v in real],
            "};",
            "",
            "const double STATE_NOMINALS[N_STATES] = {",
            *[f"    {float(v.nominal or 1.0)!r}," for v in table.kind("state")],
            "};",
            "",
            "const int BOOLEAN_STARTS[N_BOOLEAN] = {",
            *[f"    {int(bool(v.start))}, /* {v.name} */" for v in table.kind("boolean")],
            "};",
            "",
        ]
    )


def _bound(value: float | None, default: str) -> str:
    return default if value is None else repr(float(value))
