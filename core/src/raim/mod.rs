//! One-epoch integrity tests, exclusion and slope-based protection levels.
