//! Every legal domain value comes back from its native frame as it was, bit for bit; whatever a
//! payload must not hold is refused.

use proptest::prelude::*;
use surefix_core::config::{Config, IonosphereModel, NoisePreset, TroposphereModel};
use surefix_core::consts::{MAX_SATELLITES, MAX_SIGNALS};
use surefix_core::gnss::observation::EpochFlags;
use surefix_core::gnss::satellite::SystemSet;
use surefix_core::gnss::{
    Ephemeris, KlobucharParameters, NavMessage, ObservationEpoch, Satellite, Signal,
    SignalObservation, System,
};
use surefix_core::ingest::{self, MAX_EPOCH_BYTES, ObservationGroup, PayloadError};
use surefix_core::integrity::Phase;
use surefix_core::time::{GpsTime, NS_PER_WEEK};
use surefix_core::wire::native::{Frame, Kind, MAX_FRAME};

fn satellite() -> impl Strategy<Value = Satellite> {
    (0..Satellite::COUNT).prop_map(|index| Satellite::from_index(index).unwrap())
}

fn time() -> impl Strategy<Value = GpsTime> {
    (0..NS_PER_WEEK * 8192).prop_map(GpsTime::from_ns)
}

fn small() -> impl Strategy<Value = f64> {
    prop_oneof![
        -1e-3..1e-3,
        Just(0.0),
        Just(-0.0),
        Just(f64::MIN_POSITIVE / 3.0)
    ]
}

fn signal() -> impl Strategy<Value = SignalObservation> {
    (
        b'1'..=b'9',
        b'A'..=b'Z',
        proptest::option::of(-1e10..1e10),
        proptest::option::of(-1e10..1e10),
        proptest::option::of(-1e6..1e6),
        proptest::option::of(0_f32..100.0),
    )
        .prop_map(|(band, attribute, pseudorange_m, phase, rate, cn0_dbhz)| {
            let mut observation = SignalObservation::new(Signal::new(band, attribute).unwrap());
            observation.pseudorange_m = pseudorange_m;
            observation.carrier_phase_cycles = phase;
            observation.range_rate_mps = rate;
            observation.cn0_dbhz = cn0_dbhz;
            observation
        })
}

fn epoch() -> impl Strategy<Value = ObservationEpoch> {
    let signals = proptest::collection::vec(signal(), 1..=MAX_SIGNALS);
    let satellites = proptest::collection::vec((satellite(), signals), 0..=MAX_SATELLITES);
    (time(), any::<[bool; 4]>(), satellites).prop_map(|(time, bits, satellites)| {
        let mut epoch = ObservationEpoch::EMPTY;
        epoch.restart(time);
        for (satellite, signals) in satellites {
            for signal in signals {
                let _ = epoch.add(satellite, signal);
            }
        }
        epoch.flags = EpochFlags {
            incomplete: bits[0],
            overflow: bits[1],
            week_unknown: bits[2],
            clock_reset: bits[3],
        };
        epoch
    })
}

fn ephemeris() -> impl Strategy<Value = Ephemeris> {
    (
        (satellite(), any::<bool>(), time(), time(), 0..604_800_u32),
        (any::<u16>(), any::<u16>(), 1.0..8192.0, 0.0..0.5),
        proptest::array::uniform5(-6.2..6.2_f64),
        proptest::array::uniform12(small()),
        proptest::option::of(0.0..6144.0),
    )
        .prop_map(
            |((satellite, inav, toe, toc, sow), (issue, health, sqrt_a, e), angle, s, sigma)| {
                Ephemeris {
                    satellite,
                    message: match satellite.system() {
                        System::Gps => NavMessage::GpsLnav,
                        System::Galileo if inav => NavMessage::GalileoInav,
                        System::Galileo => NavMessage::GalileoFnav,
                        System::Bds => NavMessage::BdsD1D2,
                    },
                    toe,
                    toc,
                    toe_sow_s: sow.into(),
                    issue,
                    sqrt_a,
                    eccentricity: e,
                    i0_rad: angle[0],
                    idot_radps: s[0],
                    omega0_rad: angle[1],
                    omega_dot_radps: s[1],
                    argument_of_perigee_rad: angle[2],
                    m0_rad: angle[3],
                    delta_n_radps: s[2],
                    cuc_rad: s[3],
                    cus_rad: s[4],
                    crc_m: angle[4] * 100.0,
                    crs_m: angle[0] * 100.0,
                    cic_rad: s[5],
                    cis_rad: s[6],
                    af0_s: s[7],
                    af1_sps: s[8],
                    af2_sps2: s[9],
                    group_delay_s: [s[10], s[11]],
                    sigma_ura_m: sigma,
                    health,
                }
            },
        )
}

fn config() -> impl Strategy<Value = Config> {
    (
        1_u8..8,
        0.0..1.0,
        0_u8..9,
        0_u8..3,
        any::<bool>(),
        any::<bool>(),
        proptest::option::of(0_u16..8192),
        0_u8..4,
    )
        .prop_map(
            |(systems, mask_rad, phase, iono, tropo, noise, reference_week, max)| Config {
                systems: SystemSet::from_bits(systems),
                mask_rad,
                phase: Phase::from_u8(phase).unwrap(),
                ionosphere: [
                    IonosphereModel::None,
                    IonosphereModel::Klobuchar,
                    IonosphereModel::IonosphereFree,
                ][iono as usize],
                troposphere: if tropo {
                    TroposphereModel::Saastamoinen
                } else {
                    TroposphereModel::None
                },
                noise: if noise {
                    NoisePreset::Airborne
                } else {
                    NoisePreset::Elevation
                },
                reference_week,
                max_exclusions: max,
            },
        )
}

/// The groups of consecutive frames put together again.
fn epoch_of(bytes: &[u8]) -> ObservationEpoch {
    let mut epoch = ObservationEpoch::EMPTY;
    let mut rest = bytes;
    let mut expected = 0;
    while !rest.is_empty() {
        let (frame, len) = Frame::parse(rest).unwrap();
        assert_eq!(frame.kind(), Some(Kind::Observations));
        let group = ObservationGroup::decode(frame.payload()).unwrap();
        assert_eq!(group.group, expected);
        if expected == 0 {
            epoch.restart(group.time);
        }
        assert_eq!(group.time, epoch.time);
        group.add_to(&mut epoch, |reason| panic!("{reason:?}"));
        epoch.flags = group.flags;
        rest = &rest[len..];
        expected += 1;
        assert_eq!(rest.is_empty(), expected == group.groups);
    }
    epoch
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn observations_come_back(epoch in epoch()) {
        let mut out = vec![0; MAX_EPOCH_BYTES];
        let len = ingest::encode_observations(&epoch, &mut out).unwrap();
        prop_assert_eq!(epoch_of(&out[..len]), epoch.clone());
        prop_assert!(ingest::encode_observations(&epoch, &mut out[..len - 1]).is_err());
    }

    #[test]
    fn ephemerides_come_back(ephemeris in ephemeris()) {
        let mut out = [0; MAX_FRAME];
        let len = ingest::encode_ephemeris(&ephemeris, &mut out).unwrap();
        let (frame, used) = Frame::parse(&out).unwrap();
        prop_assert_eq!((used, frame.kind()), (len, Some(Kind::Ephemeris)));
        prop_assert_eq!(ingest::decode_ephemeris(frame.payload()), Ok(ephemeris));
        for cut in 0..frame.payload().len() {
            prop_assert!(ingest::decode_ephemeris(&frame.payload()[..cut]).is_err());
        }
    }

    #[test]
    fn klobuchar_parameters_come_back(bds in any::<bool>(), alpha in proptest::array::uniform4(small()), beta in proptest::array::uniform4(-1e6..1e6)) {
        let system = if bds { System::Bds } else { System::Gps };
        let parameters = KlobucharParameters { system, alpha, beta };
        let mut out = [0; MAX_FRAME];
        ingest::encode_klobuchar(&parameters, &mut out).unwrap();
        let (frame, _) = Frame::parse(&out).unwrap();
        prop_assert_eq!(ingest::decode_klobuchar(frame.payload()), Ok(parameters));
    }

    #[test]
    fn configurations_come_back(config in config()) {
        let mut out = [0; MAX_FRAME];
        ingest::encode_configuration(&config, &mut out).unwrap();
        let (frame, _) = Frame::parse(&out).unwrap();
        prop_assert_eq!(ingest::decode_configuration(frame.payload()), Ok(config));
    }

    /// Whatever a payload says, decoding either refuses it or gives what encodes to the same bytes.
    #[test]
    fn what_is_accepted_encodes_to_the_same_bytes(ephemeris in ephemeris(), config in config(), epoch in epoch(), at in any::<usize>(), byte in any::<u8>()) {
        let mut out = vec![0; MAX_EPOCH_BYTES];
        let mut again = vec![0; MAX_EPOCH_BYTES];
        let len = ingest::encode_ephemeris(&ephemeris, &mut out).unwrap();
        let mut payload = out[6..len - 4].to_vec();
        let place = at % payload.len();
        payload[place] = byte;
        if let Ok(changed) = ingest::decode_ephemeris(&payload) {
            ingest::encode_ephemeris(&changed, &mut again).unwrap();
            prop_assert_eq!(&again[6..len - 4], &payload[..]);
        }

        let len = ingest::encode_configuration(&config, &mut out).unwrap();
        let mut payload = out[6..len - 4].to_vec();
        let place = at % payload.len();
        payload[place] = byte;
        if let Ok(changed) = ingest::decode_configuration(&payload) {
            ingest::encode_configuration(&changed, &mut again).unwrap();
            prop_assert_eq!(&again[6..len - 4], &payload[..]);
        }

        ingest::encode_observations(&epoch, &mut out).unwrap();
        let (frame, _) = Frame::parse(&out).unwrap();
        let mut payload = frame.payload().to_vec();
        let place = at % payload.len();
        payload[place] = byte;
        if let Ok(group) = ObservationGroup::decode(&payload) {
            let mut epoch = ObservationEpoch::EMPTY;
            group.add_to(&mut epoch, |_| {});
        }
    }
}

#[test]
fn numbers_that_are_none_and_names_that_do_not_exist_are_refused() {
    let parameters = KlobucharParameters {
        system: System::Gps,
        alpha: [0.0, 0.0, f64::NAN, 0.0],
        beta: [0.0; 4],
    };
    let mut out = [0; MAX_FRAME];
    ingest::encode_klobuchar(&parameters, &mut out).unwrap();
    let (frame, _) = Frame::parse(&out).unwrap();
    assert_eq!(
        ingest::decode_klobuchar(frame.payload()),
        Err(PayloadError::NotFinite)
    );
    let mut payload = [0; 65];
    payload[0] = System::Galileo as u8;
    assert_eq!(
        ingest::decode_klobuchar(&payload),
        Err(PayloadError::Choice { number: 1 })
    );

    let config = Config {
        mask_rad: 2.0,
        ..Config::PRESET
    };
    ingest::encode_configuration(&config, &mut out).unwrap();
    let (frame, _) = Frame::parse(&out).unwrap();
    assert_eq!(
        ingest::decode_configuration(frame.payload()),
        Err(PayloadError::Configuration)
    );

    let mut epoch = ObservationEpoch::EMPTY;
    let mut observation = SignalObservation::new(Signal::C1C);
    observation.pseudorange_m = Some(f64::INFINITY);
    epoch
        .add(Satellite::new(System::Gps, 1).unwrap(), observation)
        .unwrap();
    ingest::encode_observations(&epoch, &mut out).unwrap();
    let (frame, _) = Frame::parse(&out).unwrap();
    assert!(matches!(
        ObservationGroup::decode(frame.payload()),
        Err(PayloadError::NotFinite)
    ));
    let mut payload = frame.payload().to_vec();
    payload[13] = 33; // G33
    assert!(matches!(
        ObservationGroup::decode(&payload),
        Err(PayloadError::Satellite { system: 0, prn: 33 })
    ));
}

#[test]
fn a_full_epoch_fits_the_buffer_it_is_said_to_fit() {
    let mut epoch = ObservationEpoch::EMPTY;
    for index in 0..MAX_SATELLITES {
        for attribute in (b'A'..).take(MAX_SIGNALS) {
            let mut observation = SignalObservation::new(Signal::new(b'1', attribute).unwrap());
            observation.pseudorange_m = Some(2e7);
            observation.carrier_phase_cycles = Some(1e8);
            observation.range_rate_mps = Some(-1.0);
            observation.cn0_dbhz = Some(45.0);
            epoch
                .add(Satellite::from_index(index).unwrap(), observation)
                .unwrap();
        }
    }
    let mut out = vec![0; MAX_EPOCH_BYTES];
    let len = ingest::encode_observations(&epoch, &mut out).unwrap();
    assert_eq!(epoch_of(&out[..len]), epoch);
    println!("a full epoch takes {len} of {MAX_EPOCH_BYTES} bytes");
}
