//! `linalg`, `raim`.

use crate::call::{call1, call2, call3, call4};
use core::hint::black_box;
use surefix_core::consts::{MAX_SATELLITES, MAX_UNKNOWNS};
use surefix_core::linalg::LinearModel;
use surefix_core::linalg::qr::WhitenedQr;
use surefix_core::raim::bias::{self, BiasEstimate};
use surefix_core::raim::exclusion::{self, ExclusionWorkspace, RowSet};
use surefix_core::raim::gdop4;
use surefix_core::raim::level::LevelFactors;
use surefix_core::raim::ls::{self, LeastSquaresWorkspace};
use surefix_core::raim::slope::{self, Sensitivity};
use surefix_core::raim::thresholds::RaimTable;
use surefix_core::raim::{TestStatistic, parity};

pub fn all() {
    let mut model = LinearModel::EMPTY;
    black_box(&mut model);
    let mut qr = WhitenedQr::EMPTY;
    orthogonal_triangular(&model, &mut qr);

    let mut table = RaimTable::EMPTY;
    call3(RaimTable::fill, &mut table, 1e-7, 1e-3);
    call2(RaimTable::threshold, &table, 0);
    call2(RaimTable::sqrt_noncentrality, &table, 0);

    call2(parity::test, &model, &mut qr);
    call1(parity::statistic, &qr);
    if let Ok(statistic) = parity::statistic(&qr) {
        call2(TestStatistic::passes, &statistic, 0.0);
    }
    let mut workspace = LeastSquaresWorkspace::EMPTY;
    call2(ls::test, &model, &mut workspace);
    call1(LeastSquaresWorkspace::projector, &workspace);
    call1(LeastSquaresWorkspace::residuals, &workspace);

    let mut workspace = ExclusionWorkspace::EMPTY;
    call4(exclusion::identify, &qr, &table, 3, &mut workspace);
    if let Ok(exclusion) = exclusion::identify(&qr, &table, black_box(3), &mut workspace) {
        rows(exclusion.rows);
    }
    rows(RowSet::EMPTY);
    slopes(&model, &mut qr);
    call2(gdop4::pair_product, &[0.0; 3], &[1.0; 3]);
    call1(gdop4::gdop_squared, &[1.0; 6]);
    call1(gdop4::gdop, &[[0.0; 3]; 4]);
}

fn rows(rows: RowSet) {
    call2(RowSet::with, rows, 3);
    call2(RowSet::contains, rows, 0);
    call2(RowSet::contains_all, rows, rows);
    call1(RowSet::len, rows);
    call1(RowSet::is_empty, rows);
    call1(|rows| RowSet::iter(rows).sum::<usize>(), rows);
}

fn orthogonal_triangular(model: &LinearModel, qr: &mut WhitenedQr) {
    let mut row = [0.0; MAX_SATELLITES];
    call2(WhitenedQr::factor, qr, model);
    call1(WhitenedQr::n, qr);
    call1(WhitenedQr::m, qr);
    call1(WhitenedQr::sum_of_squares, qr);
    call1(WhitenedQr::condition_squared, qr);
    call1(WhitenedQr::r_inverse, qr);
    call1(|qr| WhitenedQr::parity(qr).sum::<f64>(), &*qr);
    call1(WhitenedQr::estimate, qr);
    call2(WhitenedQr::residuals, qr, &mut row);
    call3(WhitenedQr::parity_matrix_row, qr, 0, &mut row);
    call1(WhitenedQr::form_thin_q, qr);
    call1(WhitenedQr::thin_q, qr);
}

fn slopes(model: &LinearModel, qr: &mut WhitenedQr) {
    let mut sensitivity = Sensitivity::EMPTY;
    let sigma_m = [0.0; MAX_SATELLITES];
    let common_m: &[[f64; MAX_SATELLITES]] = &[[0.0; MAX_SATELLITES]];
    call2(Sensitivity::fill, &mut sensitivity, qr);
    call1(Sensitivity::leverage, &sensitivity);
    call1(Sensitivity::residual_cofactor, &sensitivity);
    call2(Sensitivity::levels, &sensitivity, 0.0);
    call4(bias::of_row, model, &sensitivity, 0, 0.0);
    call4(bias::outside, qr, &[0.0; MAX_UNKNOWNS], 0.0, 1.0);
    if let Some(estimate) = bias::of_row(model, &sensitivity, black_box(0), black_box(0.0)) {
        call1(BiasEstimate::square, &estimate);
    }
    call4(
        Sensitivity::position_covariance,
        &sensitivity,
        model,
        &sigma_m,
        common_m,
    );
    let covariance = sensitivity.position_covariance(model, &sigma_m, common_m);
    call1(slope::semi_major_axis_m, &covariance);
    call2(LevelFactors::new, 1e-3, 1e-7);
    let factors = LevelFactors::new(black_box(1e-3), black_box(1e-7));
    if let (Ok(factors), Ok(levels)) = (factors, sensitivity.levels(black_box(1.0))) {
        call3(LevelFactors::levels_m, &factors, &levels, &covariance);
    }
}
