"""Every number that decides in a diagnosis, with its reason. Log odds and evidence are in nats.

Beside these, `comparison.compare.ADEQUATE_P` says from which p-value on a model is adequate, and
`search.loop.MAY_STILL_GAIN` what a hypothesis may gain if it is searched for with care.
"""

from math import log

# Difference in log odds at which the weaker of two hypotheses is given up: it is then twenty times
# less probable (e^3 = 20).
DECISIVE = 3.0
# How much wider that margin is where the base model already passes its comparison: the effect is
# then so faint that more hypotheses stay possible.
FAINT_FACTOR = 2.0
# Log odds at which an effect is believed although the base model passes its comparison: a test that
# looks everywhere notices less than one that knows where to look (e^7 = 1100).
CONVINCING = 7.0
# Log evidence by which the data themselves must speak for a name: with less, only what was believed
# beforehand separates it from its rival (10^0.5 times: H. Jeffreys, Theory of Probability, 3rd ed.
# 1961, app. B, 'substantial').
SUBSTANTIAL = log(10) / 2
# The log odds that a clip gives for the truth over a rival scatter: where x nats are expected, by
# sqrt(2 x) (a ratio of two normal densities). Nobody is as lucky as this many of these sds.
MOST_LUCK = 4.0
ROUGH_NATS = 1.0  # by which log odds may be too low, where a hypothesis was refined roughly
# Log evidence from which on the best effect is shown where the verdict is unknown.
LEAST_GAIN = 10.0
# Of the squared error beyond noise: what takes so much away is said, though more than noise stays.
NEARLY_ALL = 0.9
NOTABLE_NATS = 1.0  # a prior that is more of a lead than this is mentioned
# The probability from which on it is said that something else may be there beside what is named.
WORTH_SAYING = 0.1

# A pair must pass this p-value, not ADEQUATE_P: two effects come close to almost any motion, and
# one formula may be what they come close to. Where formulas were tried and all are far behind, a
# pair needs no more than a single effect (`pair_ahead_of_all`): else one true pair of 25 would be
# unknown. An effect that is so many times as likely as others, as the air's drag on a ball, does
# not count.
PAIR_P = 0.05
EXPECTED_ODDS = 3.0
# Two effects at once are so much rarer than one: who measures knows of most of what disturbs.
SECOND_EFFECT_ODDS = 0.1

# A formula against an effect of the library. There are some sixty formulas of one factor: all
# together come to as much as the library.
FORMULA_ODDS = 0.25
# A formula of two factors is a tenth as probable as one of one factor.
LENGTH_ODDS = 0.1
# An effect of so many constants (how strong, where, how wide) can imitate many motions.
MANY_CONSTANTS = 3

# Standard deviations of its prior from its middle, where nobody's ramp, table or clock is: what is
# wrong is the scene that was declared.
INCREDIBLE_SDS = 6.0
# Standard deviations below zero at which friction would push beyond doubt: that is no friction.
PUSHES_SD = 3.0
# The p-value from which on what clips that do not fit together lack is called alike.
ALIKE_P = 0.01
