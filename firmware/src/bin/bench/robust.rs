//! What is measured of robust estimation: an epoch without a fault and with two, levels included, and the parity
//! test of the same rows beside it.

use super::measure::{RUNS, Row, require};
use super::sky::{Random, model};
use core::hint::black_box;
use static_cell::ConstStaticCell;
use surefix_core::linalg::LinearModel;
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::igg3::{Igg3Config, Igg3Workspace};
use surefix_core::raim::parity;
use surefix_core::raim::reconstructed::LevelConvention;

/// Satellites and constellations.
pub const SKIES: [(usize, usize); 5] = [(6, 1), (8, 1), (12, 2), (18, 2), (24, 2)];
/// On the first two rows, m.
const FAULTS_M: [f64; 2] = [60.0, -40.0];

static MODEL: ConstStaticCell<LinearModel> = ConstStaticCell::new(LinearModel::EMPTY);
static QR: ConstStaticCell<WhitenedQr> = ConstStaticCell::new(WhitenedQr::EMPTY);
static WORKSPACE: ConstStaticCell<Igg3Workspace> = ConstStaticCell::new(Igg3Workspace::EMPTY);

/// Measures every row and prints it.
#[inline(never)]
pub fn all() {
    let (rows, qr, workspace) = (MODEL.take(), QR.take(), WORKSPACE.take());
    let mut random = Random::new(11);
    for (n, clocks) in SKIES {
        let (mut healthy, mut faulted) = (Row::new(), Row::new());
        let mut test = Row::new();
        for _ in 0..RUNS {
            model(&mut random, n, clocks, rows);
            let mut done = false;
            test.run(|| done = parity::test(black_box(rows), qr).is_ok());
            require(done, "no parity test");
            healthy.run(|| {
                black_box(bounded(black_box(rows), workspace));
            });
            for (residual_m, fault_m) in rows.residual_m.iter_mut().zip(FAULTS_M) {
                *residual_m += fault_m;
            }
            // With few satellites it may break down: that is an answer, too.
            faulted.run(|| {
                black_box(bounded(black_box(rows), workspace));
            });
        }
        let unknowns = Some(3 + clocks);
        test.print("igg3/parity", Some(n), unknowns);
        healthy.print("igg3/healthy", Some(n), unknowns);
        faulted.print("igg3/two_faults", Some(n), unknowns);
    }
}

/// Whether there is a solution with levels.
#[inline(never)]
fn bounded(model: &LinearModel, workspace: &mut Igg3Workspace) -> bool {
    workspace
        .estimate(model, &Igg3Config::CORRECTED)
        .is_ok_and(|robust| {
            LevelConvention::CORRECTED
                .levels(&robust.fit, &robust.cofactor_enu_m2)
                .is_ok()
        })
}
