"""What docs/frozen.md says in words: the steps of a frame, what order does not matter, and what is not frozen.

A step is the function that says it, below `golden_model/`, what it does, and how it rounds.
"""

INTRODUCTION = """\
# What is frozen

<!-- Made by `python -m lightloom.pages.frozen > docs/frozen.md`; a test holds it to the model. -->

Hardware repeats lightmap maintenance bit for bit. So this page states what of the model it has to repeat: formats,
constants, parameters and the order of operations. A change of any of them is a change of hardware. What each step is
for is told in [lightmaps](lightmaps.md), [selection](selection.md), [update](update.md) and
[publishing](publishing.md); what it costs, in [arithmetic](arithmetic.md).

NumPy's functions are the definition; their compiled twins have the same bits. Numbers are float32 as the [number
units](operators.md) have it: each operation rounds once, to nearest even, subnormals are zeros, there is one NaN.
`flush(a * b)` in the model is that unit. Everything else is whole numbers, which are exact unless a width is named at
which they stop.
"""

STATE = """\
From frame to frame there are, beside TEXEL_STATE of every texel: the versions of the published maps; of each map to
which side its samples departed in the last two frames, and how many of its valid texels have no sample; cursors of
the probe, the sweep, the doubts and 16 classes, and the credits of probe and sweep; with a variability map the last
frame's bin of every texel, and the scale of the thresholds. A texel has a sample where its `count` is not 0.
"""

Step = tuple[str, str, str]

PASSES: list[tuple[str, str, list[Step]]] = [
    (
        "Sight",
        "Map after map, region by region, row by row, as memory has the texels. Of valid texels that are there in this "
        "frame.",
        [
            ("scene.pose.moved_records", "Records of moving objects are carried to the frame's pose.", "float32, each"),
            (
                "engine.selection.culling.RegionBoxes.on_screen",
                "Regions of which no texel can be on the screen are left out, as below those that no record reaches. "
                "No bits: hardware may leave out more or fewer.",
                "float32, on the ends of intervals",
            ),
            (
                "engine.selection.texel_project.texel_project",
                "A texel to the screen: whether it faces the eye and where it lies.",
                "float32; places down to 1/256 pixel, then exact",
            ),
            (
                "engine.selection.texel_match.texel_match",
                "Normal and depth against four pixels: unseen, hidden, likely, seen; level of detail.",
                "float32; the level to nearest, up from the middle",
            ),
            (
                "engine.selection.visibility.Visibility.look",
                "What is in doubt asks by a ray to the eye, from the cursor of doubts on, as many as are allowed. Both "
                "tests again for the predicted view, whose levels of detail are finer by its scale.",
                "the ray's direction float32",
            ),
            (
                "engine.selection.neighbourhoods.Windows.largest",
                "What is within `near_seen` of a seen texel, or seen soon, is likely; it has the greatest level "
                "around.",
                "exact",
            ),
            (
                "engine.selection.influence.reach.touched",
                "Which maps an INFLUENCE record may reach, by the loose boxes that the host gives.",
                "float32",
            ),
            (
                "engine.selection.influence.reach.texel_changes",
                "Which of their texels: the greatest change level and the greatest expected change of all records.",
                "float32 against the record, then exact",
            ),
        ],
    ),
    (
        "Classes",
        "What was seen, the state and the published texels of level 0 go in; a class of four bits comes out. All "
        "windows together reach REACH texels, and over no chart's border.",
        [
            (
                "engine.selection.variability.Variability.look",
                "With `variability_bits`: bins by thresholds, widened, guarded, in rings; then the scale moves.",
                "contrast float32, the rest exact; the scaled threshold down",
            ),
            (
                "engine.selection.neighbourhoods.Windows.total",
                "How many of nine texels noticed a change; where enough did it is believed, and spreads.",
                "exact",
            ),
            (
                "engine.selection.classes.needs",
                "Never sampled, few samples, old: by `count` and by the age modulo FRAMES.",
                "exact",
            ),
            (
                "engine.selection.classes.class_table",
                "The class is looked up by level, need, bin, change and degree.",
                "a table",
            ),
            (
                "engine.selection.tracking.most_worth",
                "What an average is worth at most: bias, deviation and number of nine settled texels.",
                "logarithms down to half octaves; products exact",
            ),
        ],
    ),
    (
        "Turns",
        "Texels have a fixed order, `coarse_to_fine`. Each search begins at a cursor and goes round once.",
        [
            (
                "engine.selection.selector.coarse_to_fine",
                "So many `together` of a region of 8 x 8 by reversed Morton code, then regions by theirs, then maps.",
                "a table",
            ),
            (
                "engine.selection.classes.Share.of",
                "The probe's and the sweep's updates of this frame; what is left over is kept as credit.",
                "down to whole updates",
            ),
            (
                "engine.selection.round_robin.RoundRobin.take",
                "The probe takes its next valid texels, the sweep its next ones of degree likely or seen that are "
                "left.",
                "exact",
            ),
            (
                "engine.selection.classes.quotas",
                "From the top class down floor(R 2^c n / W) of what is left, and what remains to the top classes; the "
                "same again for what is to spare. 32 divisions, of a million texels 55 bits by 36.",
                "down",
            ),
            (
                "engine.selection.round_robin.RoundRobin.upcoming",
                "Each class takes its next members; those behind them are to spare, from the top class down.",
                "exact",
            ),
        ],
    ),
    (
        "Marks",
        "In the state of all texels, before any is sampled, in this order.",
        [
            (
                "engine.selection.selector.Plan.mark",
                "`heavy` becomes `heavy_updates` where influence has level `heavy_level` or a change is believed.",
                "exact",
            ),
            ("engine.sampling.confidence.limit", "`count` is at most what tracking says.", "exact"),
            (
                "engine.sampling.confidence.lower",
                "`count` is n / (1 + n x x / (s s)) where influence expects a change by x: powers of two, and one "
                "division of 44 bits by 44, whose quotient has 12. Texels that become stale are named to publishing.",
                "to nearest, up from the middle; never to 0 but by all of it",
            ),
        ],
    ),
    (
        "Updates",
        "The texels of the plan and then those to spare, in their order.",
        [
            (
                "engine.maintainer.Maintainer.run",
                "A texel is admitted while the rays that those before it took and its own reserve are within the "
                "budget. "
                "On a map that drifts `heavy` becomes 1 where it is 0; with `invalidate` old values are dropped.",
                "exact",
            ),
            (
                "engine.sampling.texel_rays.indirect_rays",
                "`directions` rays: run number xor hash of the table, turned by the hash, about the normal.",
                "float32; normal x tangent by differences of products",
            ),
            (
                "rays.light_samples.direct_candidates",
                "`light_samples` candidates, Sobol' points xor hashes; a light by its share of whole numbers and a "
                "place "
                "on it by what is left of the fraction, 63 bits by 31. Those without light are not traced.",
                "float32; the fraction down",
            ),
            (
                "numerics.counter_rng.hash_u32",
                "Hashes of the model's texel number, the seed, the update.",
                "modulo 2^32",
            ),
            (
                "engine.sampling.gather.gather",
                "A path adds what each of its rays brings times its weight, in the order of its rays; then for its "
                "first "
                "ray the light met. Each shadow ray that arrives is a contribution of its own.",
                "float32",
            ),
            (
                "tables.lightmap.bilinear",
                "What a hit reads of the newest version of the published maps.",
                "places to nearest 1/256; the sum exact, then once to float32",
            ),
            ("rays.surface_shading.reflected", "(albedo E) (1 / pi).", "float32"),
            ("rays.light_samples.met_emission", "A light that a ray meets, by the power heuristic.", "float32"),
            (
                "rays.hit_shading.scatter",
                "Mirrors and glass: one ray goes on, chosen by a hash of the path.",
                "float32; triangle normals by differences of products",
            ),
            (
                "engine.sampling.accumulate.accumulate",
                "Contributions, those of paths times pi / directions, to fixed point, 32 bits, and their sum.",
                "to nearest, saturating, NaN 0; the sum exact",
            ),
            (
                "engine.sampling.accumulate.luminance_sums",
                "(r + 2 g + b) / 16 of the rounded contributions, and its square, by kind of ray.",
                "down, 0 to 24 bits; the sums exact",
            ),
            (
                "engine.sampling.running_average.blend_texels",
                "A heavy texel is worth `HEAVY_WORTH` at most before it is blended; `frame`; `number` one on.",
                "exact",
            ),
            (
                "engine.sampling.texel_blend.texel_blend",
                "The running average, what it is worth, deviation, bias, spread, and whether a change was noticed.",
                "float32; 256ths to nearest; running means away from zero",
            ),
            (
                "engine.drift.departures",
                "Sums over the samples of a map and frame, in 24 bits: does it depart to one side by more than chance?",
                "down to 24 bits, then exact: the sums have up to 71 bits, the comparison 96",
            ),
        ],
    ),
    (
        "Publishing",
        "Of regions that show a texel that was updated or became stale; of maps with texels that have no sample, "
        "also all "
        "regions that show one. What a region reads of others is their state after all updates of the frame. Without "
        "`Pipeline.smoothing` that step falls away.",
        [
            (
                "engine.publishing.filling.in_half",
                "What a texel shows without smoothing: its average, 65504 at most.",
                "to binary16, nearest even",
            ),
            (
                "engine.publishing.filling.Filler.fill",
                "Of a map with texels without a sample: means of cells of a side, level by level, then reads between "
                "cells. A side that knows nothing keeps what it knew, or shows the mean of the others.",
                "whole numbers of 2^-24: means and reads down, then to float32 and to binary16",
            ),
            (
                "engine.publishing.smoothing.Smoother.smoothed",
                "What has no sample takes the mean of fresh texels, what is stale is brought into their range; "
                "means of nine of luminance and noise; a pass with neighbours "
                "one texel away, of 12 x 12 texels around a region, and one with those two away.",
                "sums exact; each pass to float32 and then to binary16; logarithms, shares and means down",
            ),
            (
                "engine.publishing.smoothing.noise_of",
                "The logarithm of a texel's standard error, of its spread or deviation, count and luminance; of an "
                "average of 15 samples and more half of it.",
                "down to half octaves",
            ),
            (
                "engine.publishing.publisher.Publisher.difference",
                "Empty and buried texels repeat the texel that `fill` names, with its weight: 1 where it has a sample.",
                "exact",
            ),
            (
                "engine.publishing.mipmaps.renew_levels",
                "Three levels of the region, then those above it, each of the published level below, by coverage.",
                "float32 in the order (0,0), (0,1), (1,0), (1,1), then to binary16",
            ),
            (
                "engine.publishing.flip_chain.FlipChain.commit",
                "The version is complete. Updates of frame k read the newest one and make the next, which frame "
                "k + versions - 1 shows.",
                "exact",
            ),
        ],
    ),
]

ORDER = """\
- **Rays and contributions**: sums of a texel are of whole numbers, so rays may return in any order, and texels may be
  sampled in any order or at once; the set that is admitted depends on the rays that those before it took, not on
  time. Only the rays of one path follow each other.
- **Samples of a map** (drift), members of classes, texels without a sample: counters and sums of whole numbers.
- **INFLUENCE records**: the greatest level and the greatest expected change count.
- **Reads, smoothing, fills**: exact sums, rounded at the end. Only coarser levels are made of sums of float32, in the
  order given.
- **Regions**: each is made of the state after the updates; in which order they are written does not matter, but for
  the levels above them, which follow them.
- **Traversal**: the nearest hit is a function of ray and triangles; of equally near ones the lowest number.
"""

NOT_FROZEN = """\
The host makes it, and may make it otherwise; hardware reads what comes of it.

- **Once a scene**: charts, records, sides, links, `fill`, `deepest`, which texels are smoothed together, the cells of
  fills and what they are read between, the order of turns, the unit of light and the accumulators' binary point
  (`fraction_bits`), lights' tables (`lights_of`: float64), sky tables, textures.
- **Every frame**: poses, cameras, the predicted view, the tree over the triangles (any tree gives the same hits), the
  G-buffer until there is a rasterizer, what changed and its INFLUENCE records (`driver.volumes`, `driver.changes`:
  float64; `driver.footprints`), loose boxes of maps (`driver.report`), the lights' tables where they move, the budget.
- **Before the first frame**: how many rounds of priming, when light has come to rest, and in which frames what comes
  later is sampled. A round itself is updates.
- **Pictures**: fragments, the rays of a frame and the display are not maintenance; their reads of the maps are those
  above.
- **Figures**: what is counted for reports, `Difference.ready`, the machine's schedule and cycles.
"""
