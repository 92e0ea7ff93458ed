//! Tails and quantiles of the normal and the chi-square distribution.
