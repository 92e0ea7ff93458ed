use super::*;
use crate::ins::{InertialNoise, SensorRange, UnitSample};
use std::vec::Vec;

/// A tactical unit.
fn tactical() -> UnitConfig {
    UnitConfig {
        interval_ns: 10_000_000,
        c_b_s: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        lever_arm_b_m: [0.0; 3],
        noise: InertialNoise {
            arw: 3e-5,
            vrw: 5e-4,
            gyro_bias_walk: 1e-7,
            accel_bias_walk: 3e-5,
        },
        range: SensorRange {
            rate_radps: 5.0,
            specific_force_mps2: 100.0,
        },
        tolerance: UnitTolerance {
            gyro_bias_radps: 5e-6,
            accel_bias_mps2: 1e-2,
            scale: 3e-4,
            timing_s: 1e-4,
        },
    }
}

/// A body that swings about z and rests otherwise, measured by units with noise.
struct Rig {
    voting: Voting,
    configs: [Option<UnitConfig>; MAX_UNITS],
    random: u64,
    /// Samples of each unit so far.
    count: [i64; MAX_UNITS],
    bias: [Channels; MAX_UNITS],
    output: Vec<ImuSample>,
}

const RATE: f64 = 0.2;

impl Rig {
    fn new(configs: [Option<UnitConfig>; MAX_UNITS]) -> Self {
        let mut voting = Voting::EMPTY;
        voting.begin(10_000_000).unwrap();
        for (number, config) in configs.iter().enumerate() {
            if let Some(config) = config {
                voting.add(number as u8, config).unwrap();
            }
        }
        Self {
            voting,
            configs,
            random: 1,
            count: [0; MAX_UNITS],
            bias: [
                sensor_bias(3e-6, 5e-3),
                sensor_bias(-4e-6, 2e-3),
                sensor_bias(1e-6, -8e-3),
            ],
            output: Vec::new(),
        }
    }

    fn three() -> Self {
        Self::new([Some(tactical()); 3])
    }

    /// Sum of twelve uniform numbers: normal enough, and the same everywhere.
    fn normal(&mut self) -> f64 {
        (0..12).fold(-6.0, |sum, _| {
            self.random = self
                .random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            sum + (self.random >> 11) as f64 / (1_u64 << 53) as f64
        })
    }

    /// The next sample of a unit, true increments at its place with its errors.
    fn sample(&mut self, unit: usize) -> UnitSample {
        let config = self.configs[unit].unwrap();
        self.count[unit] += 1;
        let interval_ns = i64::from(config.interval_ns);
        let end_ns = self.count[unit] * interval_ns;
        let (from_s, to_s) = (seconds(end_ns - interval_ns), seconds(end_ns));
        let h = to_s - from_s;
        // ω = A sin t, α = A cos t about z.
        let [x, y, _] = config.lever_arm_b_m;
        let turn = RATE * (libm::cos(from_s) - libm::cos(to_s));
        let alpha = RATE * (libm::sin(to_s) - libm::sin(from_s));
        let square = |t: f64| RATE * RATE * (0.5 * t - 0.25 * libm::sin(2.0 * t));
        let omega2 = square(to_s) - square(from_s);
        let truth = Channels::new(
            0.0,
            0.0,
            turn,
            -alpha * y - omega2 * x,
            alpha * x - omega2 * y,
            -9.8 * h,
        );
        let root = libm::sqrt(h);
        let mut measured = truth + self.bias[unit] * h;
        for (channel, part) in measured.iter_mut().enumerate() {
            let density = if channel < 3 {
                config.noise.arw
            } else {
                config.noise.vrw
            };
            *part += density * root * self.normal();
        }
        let m = measured;
        UnitSample {
            sample: ImuSample {
                time: GpsTime::from_ns(end_ns),
                interval_ns: config.interval_ns,
                dtheta_is_s_rad: [m.x, m.y, m.z],
                dv_is_s_mps: [m.w, m.a, m.b],
            },
            is_valid: true,
            temperature_c: None,
        }
    }

    fn give(&mut self, unit: usize, sample: &UnitSample) {
        self.voting.take(unit, sample);
        while let Some(sample) = self.voting.next_sample() {
            self.output.push(sample);
        }
    }

    /// All units until `to_s`, `disturb` changes their samples.
    fn run(&mut self, to_s: f64, mut disturb: impl FnMut(usize, &mut UnitSample) -> bool) {
        loop {
            let ends = [0, 1, 2].map(|unit| {
                self.configs[unit].map_or(i64::MAX, |config| {
                    (self.count[unit] + 1) * i64::from(config.interval_ns)
                })
            });
            let unit = (0..3).min_by_key(|unit| ends[*unit]).unwrap();
            if seconds(ends[unit]) > to_s + 1e-9 {
                return;
            }
            let mut sample = self.sample(unit);
            if disturb(unit, &mut sample) {
                self.give(unit, &sample);
            }
        }
    }

    fn states(&self) -> [UnitFault; 3] {
        [0, 1, 2].map(|unit| self.voting.unit(unit).1)
    }
}

fn sensor_bias(gyro: f64, accel: f64) -> Channels {
    parity::sensors(gyro, accel)
}

fn healthy(_: usize, _: &mut UnitSample) -> bool {
    true
}

/// INT-086
#[test]
fn a_healthy_trio_gives_the_mean_and_nobody_is_isolated() {
    let mut rig = Rig::three();
    let mut sums = Vec::new();
    let mut current = Channels::zeros();
    rig.run(200.0, |unit, sample| {
        let s = &sample.sample;
        let [x, y, z] = s.dtheta_is_s_rad;
        let [fx, fy, fz] = s.dv_is_s_mps;
        current += Channels::new(x, y, z, fx, fy, fz) / 3.0;
        if unit == 2 {
            sums.push(std::mem::replace(&mut current, Channels::zeros()));
        }
        true
    });
    assert_eq!(rig.voting.mode(), VotingMode::Three);
    assert_eq!(rig.output.len(), 20_000);
    for (output, sum) in rig.output.iter().zip(&sums) {
        let [x, y, z] = output.dtheta_is_s_rad;
        let [fx, fy, fz] = output.dv_is_s_mps;
        let apart = Channels::new(x, y, z, fx, fy, fz) - sum;
        assert!(apart.norm() < 1e-15, "{apart}");
    }
}

/// INT-090
#[test]
fn the_output_ends_where_its_cell_does_and_waits_for_nobody_longer_than_told() {
    let slow = UnitConfig {
        interval_ns: 20_000_000,
        ..tactical()
    };
    let mut rig = Rig::new([Some(tactical()), Some(slow), Some(tactical())]);
    let mut newest_ns = 0;
    let mut latency_ns = 0;
    for step in 1..=1000 {
        for unit in [0, 2] {
            let sample = rig.sample(unit);
            newest_ns = sample.sample.time.ns();
            rig.give(unit, &sample);
        }
        // From 5 s on the slow unit says nothing.
        if step % 2 == 0 && step < 500 {
            let sample = rig.sample(1);
            rig.give(1, &sample);
        }
        let last_ns = rig.output.last().map_or(0, |last| last.time.ns());
        latency_ns = latency_ns.max(newest_ns - last_ns);
        if step < 500 {
            assert!(newest_ns - last_ns <= 20_000_000, "{step}");
        }
    }
    assert!(latency_ns <= 60_000_000, "{latency_ns}");
    assert_eq!(newest_ns, rig.output.last().unwrap().time.ns());
    assert_eq!(rig.voting.unit(1), (UnitState::Silent, UnitFault::Silent));
    let ends: Vec<_> = rig.output.iter().map(|s| s.time.ns()).collect();
    assert!(ends.windows(2).all(|pair| pair[1] - pair[0] == 10_000_000));
}

/// INT-085
#[test]
fn each_kind_of_fault_isolates_its_unit_and_no_other() {
    let at_ns = 30_000_000_000;
    type Disturb = fn(&mut UnitSample, f64) -> bool;
    let kinds: [(&str, Disturb, &[UnitFault]); 9] = [
        (
            "step",
            |s, _| {
                s.sample.dtheta_is_s_rad[1] += 1e-3 * 0.01;
                true
            },
            &[UnitFault::Difference],
        ),
        (
            "drift",
            |s, t| {
                s.sample.dv_is_s_mps[0] += 1e-3 * t * 0.01;
                true
            },
            &[UnitFault::Difference, UnitFault::Drift],
        ),
        (
            "scale",
            |s, _| {
                s.sample.dtheta_is_s_rad[2] *= 1.02;
                true
            },
            &[UnitFault::Difference, UnitFault::Drift, UnitFault::Delay],
        ),
        (
            "stuck",
            |s, _| {
                s.sample.dtheta_is_s_rad[0] = 1e-9;
                true
            },
            &[UnitFault::Stuck],
        ),
        (
            "noise",
            |s, t| {
                let sign = if (t * 100.0).round() as i64 % 2 == 0 {
                    1.0
                } else {
                    -1.0
                };
                s.sample.dv_is_s_mps[1] += sign * 3.0 * 5e-4 * 0.1;
                true
            },
            &[UnitFault::Noise],
        ),
        ("silence", |_, _| false, &[UnitFault::Silent]),
        (
            "no numbers",
            |s, _| {
                s.sample.dv_is_s_mps[2] = f64::NAN;
                true
            },
            &[UnitFault::NotFinite],
        ),
        (
            "saturated",
            |s, _| {
                s.sample.dv_is_s_mps[2] = 1.0;
                true
            },
            &[UnitFault::Saturated],
        ),
        (
            "status",
            |s, _| {
                s.is_valid = false;
                true
            },
            &[UnitFault::Status],
        ),
    ];
    for (name, disturb, causes) in kinds {
        for faulty in 0..3 {
            let mut rig = Rig::three();
            rig.run(60.0, |unit, sample| {
                let since_ns = sample.sample.time.ns() - at_ns;
                unit != faulty || since_ns <= 0 || disturb(sample, since_ns as f64 / 1e9)
            });
            let states = rig.states();
            for (unit, state) in states.iter().enumerate() {
                if unit == faulty {
                    assert!(causes.contains(state), "{name} of {faulty}: {states:?}");
                } else {
                    assert_eq!(*state, UnitFault::None, "{name} of {faulty}");
                }
            }
            assert_eq!(rig.voting.mode(), VotingMode::Two, "{name} of {faulty}");
            let count = rig.output.len();
            assert!(count >= 5_990, "{name} of {faulty}: {count}");
        }
    }
}

/// INT-085. A part that saturates for a moment, or whose FIFO was read late, is not out for a minute.
#[test]
fn few_invalid_samples_are_bridged_and_many_isolate() {
    let mut rig = Rig::three();
    // Unit 1: one in twenty, and 50 ms once. All three at 30 s, as a knock would have it.
    rig.run(60.0, |unit, sample| {
        let ms = sample.sample.time.ns() / 1_000_000;
        let is_knock = (30_000..30_030).contains(&ms);
        let is_own = unit == 1 && (ms % 200 == 0 || (45_010..45_050).contains(&ms));
        sample.is_valid = !is_knock && !is_own;
        true
    });
    assert_eq!(rig.states(), [UnitFault::None; 3]);
    assert!(rig.output.len() >= 5_990, "{}", rig.output.len());

    // One in four: what is left is not worth having.
    rig.run(62.0, |unit, sample| {
        sample.is_valid = unit != 1 || sample.sample.time.ns() / 10_000_000 % 4 != 0;
        true
    });
    let expected = [UnitFault::None, UnitFault::Status, UnitFault::None];
    assert_eq!(rig.states(), expected);
}

/// INT-085
#[test]
fn a_delayed_unit_is_called_so() {
    let mut rig = Rig::three();
    rig.run(20.0, healthy);
    // Times of unit 1 are 8 ms too late from here on: its measurements are older than they say.
    rig.run(120.0, |unit, sample| {
        if unit == 1 {
            sample.sample.time = sample.sample.time.plus_ns(8_000_000);
        }
        true
    });
    let states = rig.states();
    assert_eq!(states, [UnitFault::None, UnitFault::Delay, UnitFault::None]);
}

/// INT-091
#[test]
fn two_units_that_differ_give_nothing_until_they_agree_again() {
    let mut rig = Rig::new([Some(tactical()), None, Some(tactical())]);
    rig.run(20.0, healthy);
    assert_eq!(rig.voting.mode(), VotingMode::Two);
    rig.run(40.0, |unit, sample| {
        if unit == 0 {
            sample.sample.dtheta_is_s_rad[2] += 0.05 * 0.01;
        }
        true
    });
    assert_eq!(rig.voting.mode(), VotingMode::Disagree);
    let last_ns = rig.output.last().unwrap().time.ns();
    assert!(last_ns <= 20_000_000_000, "{last_ns}");
    rig.run(90.0, healthy);
    assert_eq!(rig.voting.mode(), VotingMode::Disagree);
    rig.run(120.0, healthy);
    assert_eq!(rig.voting.mode(), VotingMode::Two);
}

#[test]
fn one_unit_is_passed_on_unmonitored() {
    let mut rig = Rig::new([None, Some(tactical()), None]);
    rig.run(10.0, healthy);
    assert_eq!(rig.voting.mode(), VotingMode::One);
    assert_eq!(rig.output.len(), 1000);
}

/// INT-093
#[test]
fn an_isolated_unit_comes_back_after_a_minute_of_health_and_later_each_time() {
    let mut rig = Rig::three();
    rig.run(20.0, healthy);
    let mut back = Vec::new();
    let mut end_s = 20.0;
    for _ in 0..2 {
        rig.run(end_s + 1.0, |unit, _| unit != 2);
        assert_eq!(rig.voting.unit(2).0, UnitState::Silent);
        let from_s = end_s + 1.0;
        end_s = from_s;
        while rig.voting.unit(2).0 != UnitState::Used && end_s < from_s + 300.0 {
            end_s += 1.0;
            rig.run(end_s, healthy);
        }
        back.push(end_s - from_s);
    }
    assert!((59.0..=63.0).contains(&back[0]), "{back:?}");
    assert!((119.0..=123.0).contains(&back[1]), "{back:?}");
}

/// INT-090
#[test]
fn a_pause_of_all_units_is_none_of_any() {
    let mut rig = Rig::three();
    rig.run(20.0, healthy);
    for count in &mut rig.count {
        *count += 500;
    }
    rig.run(40.0, healthy);
    assert_eq!(rig.voting.mode(), VotingMode::Three);
    assert_eq!(rig.states(), [UnitFault::None; 3]);
}

/// INT-090
#[test]
fn a_unit_whose_clock_leaps_does_not_take_the_others_along() {
    for leap_ns in [
        3_600_000_000_000,
        -3_600_000_000_000,
        500_000_000,
        90_000_000,
    ] {
        let mut rig = Rig::three();
        rig.run(20.0, healthy);
        rig.run(40.0, |unit, sample| {
            if unit == 1 {
                sample.sample.time = sample.sample.time.plus_ns(leap_ns);
            }
            true
        });
        assert_eq!(rig.voting.mode(), VotingMode::Two, "{leap_ns}");
        assert_ne!(rig.voting.unit(1).0, UnitState::Used, "{leap_ns}");
        assert!(rig.output.len() >= 3_990, "{leap_ns}: {}", rig.output.len());
    }
}

/// INT-086
#[test]
fn lever_arms_and_mountings_are_taken_out() {
    let mut forward = tactical();
    forward.lever_arm_b_m = [0.8, 0.0, 0.0];
    let mut left = tactical();
    left.lever_arm_b_m = [0.0, -0.6, 0.3];
    let mut rig = Rig::new([Some(tactical()), Some(forward), Some(left)]);
    rig.bias = [Channels::zeros(); 3];
    rig.run(200.0, healthy);
    assert_eq!(rig.states(), [UnitFault::None; 3]);
    let sum = rig.output.iter().fold([0.0; 3], |sum: [f64; 3], sample| {
        let [x, y, z] = sample.dv_is_s_mps;
        [sum[0] + x, sum[1] + y, sum[2] + z]
    });
    // Centripetal alone would be 0.8 m · 0.02 rad²/s² · 200 s / 3 = 1.07 m/s.
    assert!(sum[0].abs() < 0.02 && sum[1].abs() < 0.02, "{sum:?}");

    let mut wrong = forward;
    wrong.lever_arm_b_m = [-0.8, 0.0, 0.0];
    let mut rig = Rig::new([Some(tactical()), Some(forward), Some(left)]);
    rig.voting.add(1, &wrong).unwrap();
    rig.run(200.0, healthy);
    assert_ne!(rig.voting.unit(1).1, UnitFault::None, "a wrong arm shows");
}

#[test]
fn the_state_is_small() {
    let bytes = size_of::<Voting>();
    assert!(bytes <= 8_192, "{bytes}");
}
