"""From a recorded trace to gains: models, identification, rules, margins, the loop's own form. binary64, no I/O."""
