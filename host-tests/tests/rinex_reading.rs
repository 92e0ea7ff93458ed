//! RINEX files are read as printed: literal lines of real files, and short files written here.

mod common;

use proptest::prelude::*;

use surefix_core::consts::SPEED_OF_LIGHT_MPS;
use surefix_core::gnss::signal::{FREQUENCY_B1I_HZ, FREQUENCY_L1_HZ};
use surefix_core::gnss::{
    NavMessage, ObservationEpoch, Satellite, Signal, SignalObservation, System,
};
use surefix_core::time::{GpsTime, NS_PER_S};
use surefix_host_tests::rinex::{
    Content, NavigationFile, ObservationCounts, ObservationReader, RinexError, read_unzipped,
    text_of,
};

fn satellite(letter: char, prn: u8) -> Satellite {
    Satellite::new(System::from_letter(letter).unwrap(), prn).unwrap()
}

fn signal(name: &str) -> Signal {
    let [band, attribute] = name.as_bytes() else {
        panic!("a signal is two characters");
    };
    Signal::new(*band, *attribute).unwrap()
}

fn observed(epoch: &ObservationEpoch, sat: Satellite, name: &str) -> SignalObservation {
    *epoch.get(sat).unwrap().signal(signal(name)).unwrap()
}

fn all_epochs(text: &str) -> (Vec<ObservationEpoch>, ObservationCounts) {
    let mut reader = ObservationReader::new(text).unwrap();
    let mut epoch = ObservationEpoch::EMPTY;
    let mut epochs = Vec::new();
    while reader.next_epoch(&mut epoch) {
        epochs.push(epoch.clone());
    }
    (epochs, reader.counts().clone())
}

/// A header line: content in columns 1 to 60, label from 61.
fn header(content: &str, label: &str) -> String {
    format!("{content:<60}{label}\n")
}

fn observation_file(codes: &[&str], scale: &str, body: &str) -> String {
    let mut text = header(
        "     3.04           O                   M",
        "RINEX VERSION / TYPE",
    );
    for line in codes {
        text += &header(line, "SYS / # / OBS TYPES");
    }
    let first = format!("  2024     2    29    23    59   30.0000000     {scale}");
    text += &header(&first, "TIME OF FIRST OBS");
    text += &header("", "END OF HEADER");
    text + body
}

#[test]
fn plain_file_of_esbc_is_read_as_printed() {
    let Some(path) = common::shared("data/esbc-2020-177/ESBC_2020177_0000-0400.rnx") else {
        return;
    };
    let (text, content) = text_of(read_unzipped(&path).unwrap()).unwrap();
    assert_eq!(content, Content::Observations);
    let reader = ObservationReader::new(&text).unwrap();
    assert_eq!(
        reader.header().approximate_position_m,
        Some([3582105.2910, 532589.7313, 5232754.8054])
    );
    assert_eq!(
        reader.header().antenna_delta_hen_m,
        Some([0.2160, 0.0, 0.0])
    );
    let (epochs, counts) = all_epochs(&text);
    assert_eq!(epochs.len(), 480);
    assert_eq!((counts.bad_epochs, counts.bad_lines), (0, 0));
    assert_eq!((counts.bad_fields, counts.no_room), (0, 0));

    // > 2020 06 25 00 00 00.0000000  0 43
    // C07  39491936.793 6  39491927.647 5  39491931.984 7      -484.694 6      -394.144 5 ...
    let first = &epochs[0];
    assert_eq!(first.time, GpsTime::from_week_tow_s(2111, 345_600));
    let c07 = observed(first, satellite('C', 7), "2I");
    assert_eq!(c07.pseudorange_m, Some(39491936.793));
    assert_eq!(c07.carrier_phase_cycles, Some(205644910.739));
    assert_eq!(
        c07.range_rate_mps,
        Some(-(SPEED_OF_LIGHT_MPS / FREQUENCY_B1I_HZ) * -484.694)
    );
    assert_eq!(c07.cn0_dbhz, Some(38.5));
    assert_eq!(
        observed(first, satellite('C', 7), "6I").pseudorange_m,
        Some(39491927.647)
    );
}

#[test]
fn compressed_day_of_esbc_equals_the_plain_hours() {
    let (Some(day), Some(hours)) = (
        common::shared("data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz"),
        common::shared("data/esbc-2020-177/ESBC_2020177_0000-0400.rnx"),
    ) else {
        return;
    };
    let (day, _) = text_of(read_unzipped(&day).unwrap()).unwrap();
    let (hours, _) = text_of(read_unzipped(&hours).unwrap()).unwrap();
    let (day, counts) = all_epochs(&day);
    let (hours, _) = all_epochs(&hours);
    assert_eq!(day.len(), 2880);
    assert_eq!((counts.bad_epochs, counts.bad_lines), (0, 0));
    assert!(
        day.iter().zip(&hours).all(|(a, b)| a == b),
        "an epoch of the day differs from the plain file"
    );
    let step = day.windows(2).map(|w| w[1].time.ns() - w[0].time.ns());
    assert!(step.into_iter().all(|ns| ns == 30 * NS_PER_S));
}

#[test]
fn a_channel_number_before_the_measurements_shifts_nothing() {
    let Some(path) = common::shared("data/matrtklib-static-2024/base.obs") else {
        return;
    };
    let (text, _) = text_of(read_unzipped(&path).unwrap()).unwrap();
    let (epochs, counts) = all_epochs(&text);
    assert_eq!((epochs.len(), counts.bad_lines), (301, 0));
    // C01         9.000    36689218.704 6 191050392.04106       305.142 6        43.469
    let c01 = observed(&epochs[0], satellite('C', 1), "2I");
    assert_eq!(c01.pseudorange_m, Some(36689218.704));
    assert_eq!(c01.carrier_phase_cycles, Some(191050392.041));
    assert_eq!(
        c01.range_rate_mps,
        Some(-(SPEED_OF_LIGHT_MPS / FREQUENCY_B1I_HZ) * 305.142)
    );
    assert_eq!(c01.cn0_dbhz, Some(43.469));
}

#[test]
fn ephemerides_of_esbc_are_read_as_printed() {
    let Some(path) = common::shared("data/esbc-2020-177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz")
    else {
        return;
    };
    let (text, content) = text_of(read_unzipped(&path).unwrap()).unwrap();
    assert_eq!(content, Content::Navigation);
    let file = NavigationFile::parse(&text).unwrap();
    assert_eq!((file.ephemerides.len(), file.bad_records), (2216, 0));
    assert_eq!(file.other_records.get("R"), Some(&510));
    let (time, gps) = file.klobuchar[0];
    assert_eq!((time, gps.system), (None, System::Gps));
    assert_eq!(gps.alpha, [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7]);
    assert_eq!(gps.beta, [81_920.0, 98_304.0, -65_536.0, -524_290.0]);

    let find = |sat, message, toe| {
        *file
            .ephemerides
            .iter()
            .find(|e| {
                let e = &e.ephemeris;
                e.satellite == sat && e.message == message && e.toe == toe
            })
            .unwrap()
    };
    // G01 2020 06 25 04 00 00 1.604342833161e-05 7.048583938740e-12 0.000000000000e+00
    let toe = GpsTime::from_week_tow_s(2111, 360_000);
    let g01 = find(satellite('G', 1), NavMessage::GpsLnav, toe);
    assert_eq!(g01.transmitted, GpsTime::from_week_tow_s(2111, 356_106));
    let e = g01.ephemeris;
    assert_eq!((e.toc, e.toe_sow_s), (toe, 360_000.0));
    assert_eq!(
        (e.af0_s, e.af1_sps, e.af2_sps2),
        (1.604342833161e-5, 7.04858393874e-12, 0.0)
    );
    assert_eq!((e.issue, e.crs_m), (58, -39.6875));
    assert_eq!(
        (e.delta_n_radps, e.m0_rad),
        (4.304822170265e-9, 6.342094507864e-1)
    );
    assert_eq!(
        (e.cuc_rad, e.eccentricity),
        (-2.177432179451e-6, 1.000394229777e-2)
    );
    assert_eq!(
        (e.cus_rad, e.sqrt_a),
        (1.937150955200e-6, 5.153707128525e+3)
    );
    assert_eq!(
        (e.cic_rad, e.omega0_rad),
        (-1.508742570877e-7, 2.572838528869)
    );
    assert_eq!(
        (e.cis_rad, e.i0_rad),
        (1.359730958939e-7, 9.806518601091e-1)
    );
    assert_eq!(
        (e.crc_m, e.argument_of_perigee_rad),
        (353.96875, 7.941703015008e-1)
    );
    assert_eq!(
        (e.omega_dot_radps, e.idot_radps),
        (-8.384634967987e-9, -5.714523747137e-11)
    );
    assert_eq!((e.sigma_ura_m, e.health), (Some(2.0), 0));
    assert_eq!(e.group_delay_s, [5.122274160385e-9, 0.0]);

    // C07 2020 06 24 22 00 00, toe 3.384e5 s of BDT week 755, transmitted 3.38418e5.
    let toe = GpsTime::from_bdt(755, 338_400);
    let c07 = find(satellite('C', 7), NavMessage::BdsD1D2, toe);
    assert_eq!(c07.transmitted, GpsTime::from_bdt(755, 338_418));
    assert_eq!(
        (c07.ephemeris.toc, c07.ephemeris.toe_sow_s),
        (toe, 338_400.0)
    );
    assert_eq!(c07.ephemeris.group_delay_s, [1.45e-8, 6e-10]);

    // E01 2020 06 24 23 30 00 twice: data sources 258 (F/NAV) and 517 (I/NAV), other clocks.
    let toe = GpsTime::from_week_tow_s(2111, 343_800);
    let fnav = find(satellite('E', 1), NavMessage::GalileoFnav, toe).ephemeris;
    let inav = find(satellite('E', 1), NavMessage::GalileoInav, toe).ephemeris;
    assert_eq!(fnav.af0_s, -8.846927667037e-4);
    assert_eq!(inav.af0_s, -8.846933487803e-4);
    assert_eq!(inav.group_delay_s, [-1.862645149231e-9, -2.095475792885e-9]);
    assert_eq!((inav.issue, inav.sigma_ura_m), (61, Some(3.12)));
    // E14 is unhealthy: 48 in F/NAV, 390 in I/NAV.
    let mut e14 = file
        .ephemerides
        .iter()
        .filter(|e| e.ephemeris.satellite == satellite('E', 14));
    assert!(e14.all(|e| e.ephemeris.health != 0));
}

#[test]
fn unknown_transmission_times_are_the_earliest_possible() {
    let Some(path) =
        common::shared("data/instinct-skydel-static-4h-truth/SkydelRINEX_S_20238959_7200S_GN.rnx")
    else {
        return;
    };
    let (text, _) = text_of(read_unzipped(&path).unwrap()).unwrap();
    let file = NavigationFile::parse(&text).unwrap();
    assert_eq!(file.ephemerides.len(), 124);
    assert!(
        file.ephemerides
            .iter()
            .all(|e| e.ephemeris.toe.ns() - e.transmitted.ns() == 7_200 * NS_PER_S)
    );
}

#[test]
fn blanks_and_zeros_are_no_measurements_and_broken_fields_are_counted() {
    let text = observation_file(
        &["G    4 C1C L1C D1C S1C"],
        "GPS",
        "> 2024 02 29 23 59 30.1234567  0  4\n\
         G05  20000000.123 7         0.000 7                        45.250\n\
         G06         0.000   105000000.500        -1.000\n\
         G07  2000x000.123\n\
         R05  20000000.123\n",
    );
    let (epochs, counts) = all_epochs(&text);
    assert_eq!(epochs.len(), 1);
    assert_eq!(epochs[0].time.tow_ns() % NS_PER_S, 123_456_700);
    let g05 = observed(&epochs[0], satellite('G', 5), "1C");
    assert_eq!(g05.pseudorange_m, Some(20000000.123));
    assert_eq!((g05.carrier_phase_cycles, g05.range_rate_mps), (None, None));
    assert_eq!(g05.cn0_dbhz, Some(45.25));
    let g06 = observed(&epochs[0], satellite('G', 6), "1C");
    assert_eq!(g06.pseudorange_m, None);
    assert_eq!(
        g06.range_rate_mps,
        Some(SPEED_OF_LIGHT_MPS / FREQUENCY_L1_HZ)
    );
    assert_eq!(epochs[0].get(satellite('G', 7)), None);
    assert_eq!((counts.bad_fields, counts.bad_lines), (1, 0));
    assert_eq!(counts.other_systems.get(&'R'), Some(&1));
}

#[test]
fn events_change_the_codes_and_power_failures_are_flagged() {
    let change = header("G    2 D1C C1C", "SYS / # / OBS TYPES");
    let body = format!(
        "> 2024 02 29 23 59 30.0000000  0  1\n\
         G05  20000000.000\n\
         > 2024 02 29 23 59 31.0000000  4  2\n\
         {change}{comment}\
         > 2024 02 29 23 59 32.0000000  1  1\n\
         G05         2.000    20000001.000\n",
        comment = header("antenna moved", "COMMENT"),
    );
    let text = observation_file(&["G    1 C1C"], "GPS", &body);
    let (epochs, counts) = all_epochs(&text);
    assert_eq!((epochs.len(), counts.events), (2, 1));
    assert!(!epochs[0].flags.clock_reset && epochs[1].flags.clock_reset);
    let g05 = observed(&epochs[1], satellite('G', 5), "1C");
    assert_eq!(g05.pseudorange_m, Some(20000001.0));
}

#[test]
fn epochs_in_bds_time_are_fourteen_seconds_later_in_gps_time() {
    let body = "> 2024 02 29 23 59 30.0000000  0  1\nC11  22000000.000\n";
    let (bdt, _) = all_epochs(&observation_file(&["C    1 C2I"], "BDT", body));
    let (gps, _) = all_epochs(&observation_file(&["C    1 C2I"], "GPS", body));
    assert_eq!(bdt[0].time.ns() - gps[0].time.ns(), 14 * NS_PER_S);
    let glonass = observation_file(&["C    1 C2I"], "GLO", body);
    assert!(matches!(
        ObservationReader::new(&glonass).err(),
        Some(RinexError::Unsupported(_))
    ));
}

#[test]
fn b1i_has_one_name_in_every_version() {
    let body = "> 2024 02 29 23 59 30.0000000  0  1\nC11  22000000.000    22000001.000\n";
    // Version 3.04: 1X is B1C, 2X is B1I.
    let new = observation_file(&["C    2 C1X C2X"], "GPS", body);
    let (epochs, _) = all_epochs(&new);
    assert_eq!(
        observed(&epochs[0], satellite('C', 11), "1X").pseudorange_m,
        Some(22000000.0)
    );
    // Version 3.02: 1I is B1I.
    let old = observation_file(&["C    1 C1I"], "GPS", body).replacen("3.04", "3.02", 1);
    let (epochs, _) = all_epochs(&old);
    assert_eq!(
        observed(&epochs[0], satellite('C', 11), "2I").pseudorange_m,
        Some(22000000.0)
    );
}

#[test]
fn an_epoch_with_fewer_satellites_than_announced_is_incomplete() {
    let body = "> 2024 02 29 23 59 30.0000000  0  3\n\
                G05  20000000.000\n\
                > 2024 02 29 23 59 xx.0000000  0  1\n\
                G05  20000001.000\n\
                > 2024 02 29 23 59 32.0000000  0  1\n\
                G05  20000002.000\n";
    let (epochs, counts) = all_epochs(&observation_file(&["G    1 C1C"], "GPS", body));
    assert_eq!((epochs.len(), counts.bad_epochs), (2, 1));
    assert!(epochs[0].flags.incomplete && !epochs[1].flags.incomplete);
}

/// Two satellites over three epochs; G07 misses the second and starts afresh in the third.
fn compact_file() -> String {
    let mut text = header(
        "3.0                 COMPACT RINEX FORMAT",
        "CRINEX VERS   / TYPE",
    );
    text += &header("by hand", "CRINEX PROG / DATE");
    text += &observation_file(&["G    2 C1C L1C"], "GPS", "");
    text += "> 2024 02 29 23 59 30.0000000  0  2      G05G07\n\
             \n\
             3&20000000123 3&105000000500  7 7\n\
             3&-123 \n\
             \x20                   1             1         &&&\n\
             \n\
             877 -500  8\n\
             \x20                   2             2         G07\n\
             \n\
             1000 1000\n\
             3&7 3&8 1\n";
    text
}

#[test]
fn compact_rinex_written_by_hand_expands_to_what_it_means() {
    let (plain, content) = text_of(compact_file().into_bytes()).unwrap();
    assert_eq!(content, Content::Observations);
    let (epochs, counts) = all_epochs(&plain);
    assert_eq!((epochs.len(), counts.bad_lines), (3, 0));
    let seconds = epochs.iter().map(|e| e.time.tow_ns() / NS_PER_S % 60);
    assert_eq!(seconds.collect::<Vec<_>>(), [30, 31, 32]);
    let c1 = |k: usize, prn| observed(&epochs[k], satellite('G', prn), "1C");
    assert_eq!(c1(0, 5).pseudorange_m, Some(20000000.123));
    assert_eq!(c1(0, 7).pseudorange_m, Some(-0.123));
    assert_eq!(c1(1, 5).pseudorange_m, Some(20000001.000));
    assert_eq!(c1(1, 5).carrier_phase_cycles, Some(105000000.0));
    assert_eq!(epochs[1].get(satellite('G', 7)), None);
    // Second differences: 877 + 1000 on top of the last value.
    assert_eq!(c1(2, 5).pseudorange_m, Some(20000002.877));
    assert_eq!(c1(2, 7).pseudorange_m, Some(0.007));
}

/// Ionosphere, an ephemeris of a message not used, a time offset, F/NAV and I/NAV of one satellite.
fn navigation_file() -> String {
    let mut text = header(
        "     4.00           NAVIGATION DATA     M",
        "RINEX VERSION / TYPE",
    );
    text += &header("", "END OF HEADER");
    text += "> ION G05 LNAV\n\
    \x20   2022 06 08 09 59 42 1.117587089540E-08-7.450580596924E-09-5.960464477539E-08\n\
    \x20    1.192092895508E-07 9.625600000000E+04-3.276800000000E+04-1.966080000000E+05\n\
    \x20    1.966080000000E+05\n\
    > EPH G05 CNAV\n\
    G05 2022 06 08 10 00 00 1.0\n\
    \x20    1.0\n\
    > STO G05 LNAV\n\
    \x20   2022 06 08 00 00 00 GPUT\n";
    for message in ["FNAV", "INAV"] {
        text += &format!("> EPH E12 {message}\n");
        text +=
            "E12 2022 06 08 10 00 00 1.000000000000E-04 2.000000000000E-12 0.000000000000E+00\n";
        for line in [
            " 6.000000000000E+01 1.0 2.0e-9 1.0",
            " 1.0e-6 1.0e-4 1.0e-6 5.440600000000E+03",
            " 2.952000000000E+05 1.0e-8 1.0 1.0e-8",
            " 1.0 1.0e+2 1.0 -5.0e-9",
            " 1.0e-10 0.0 2.213000000000E+03 ",
            " 3.120000000000E+00 0.0 2.0e-9 3.0e-9",
            " 2.958000000000E+05 ",
        ] {
            let fields: String = line
                .split_whitespace()
                .map(|field| format!("{field:>19}"))
                .collect();
            text += &format!("    {fields}\n");
        }
    }
    text
}

#[test]
fn rinex_4_names_messages_and_carries_the_ionosphere() {
    let text = navigation_file();
    let file = NavigationFile::parse(&text).unwrap();
    assert_eq!(file.bad_records, 0);
    assert_eq!(file.other_records.get("G CNAV"), Some(&1));
    assert_eq!(file.other_records.get("STO"), Some(&1));
    let (time, ionosphere) = file.klobuchar[0];
    assert_eq!(
        time,
        Some(GpsTime::from_week_tow_s(
            2213,
            3 * 86_400 + 9 * 3_600 + 59 * 60 + 42
        ))
    );
    assert_eq!(ionosphere.system, System::Gps);
    assert_eq!(ionosphere.alpha[3], 1.192092895508e-7);
    assert_eq!(ionosphere.beta[3], 196_608.0);
    let messages: Vec<_> = file
        .ephemerides
        .iter()
        .map(|e| (e.ephemeris.message, e.ephemeris.toe, e.transmitted))
        .collect();
    let (toe, transmitted) = (
        GpsTime::from_week_tow_s(2213, 295_200),
        GpsTime::from_week_tow_s(2213, 295_800),
    );
    assert_eq!(
        messages,
        [
            (NavMessage::GalileoFnav, toe, transmitted),
            (NavMessage::GalileoInav, toe, transmitted)
        ]
    );
}

#[test]
fn what_cannot_be_read_is_refused_with_the_next_step() {
    let old = header(
        "     2.11           OBSERVATION DATA    G",
        "RINEX VERSION / TYPE",
    );
    let error = text_of(old.into_bytes()).unwrap_err().to_string();
    assert!(
        error.contains("2.11") && error.contains("convert"),
        "{error}"
    );
    let error = text_of(b"t,x,y\n1,2,3\n".to_vec()).unwrap_err().to_string();
    assert!(error.contains("RINEX VERSION / TYPE"), "{error}");
    let clock = header("     3.00           C", "RINEX VERSION / TYPE");
    assert!(text_of(clock.into_bytes()).is_err());
}

proptest! {
    /// Damaged text gives errors and counts, never a panic.
    #[test]
    fn damaged_files_never_panic(
        which in 0..2,
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        end in any::<prop::sample::Index>(),
    ) {
        let text = if which == 0 { compact_file() } else { navigation_file() };
        let mut bytes = text.into_bytes();
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        bytes.truncate(end.index(bytes.len()) + 1);
        if let Ok((text, content)) = text_of(bytes) {
            match content {
                Content::Observations => {
                    if let Ok(mut reader) = ObservationReader::new(&text) {
                        let mut epoch = ObservationEpoch::EMPTY;
                        while reader.next_epoch(&mut epoch) {}
                    }
                }
                Content::Navigation => {
                    let _ = NavigationFile::parse(&text);
                }
            }
        }
    }
}
