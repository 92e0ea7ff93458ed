//! No panic is reachable from any public function of surefix-core, nor from the application: both
//! images link without a panic handler. One deliberate panic, and they no longer do.

use surefix_host_tests::qemu::image::{self, ImageError};

const MISSING_SYMBOL: &str = "a_panic_is_reachable_from_surefix_core";

fn ready() -> bool {
    match image::missing() {
        Some(missing) => {
            eprintln!("SKIPPED: {missing}");
            false
        }
        None => true,
    }
}

/// INT-006.
#[test]
fn the_image_that_calls_all_of_core_links_without_a_panic() {
    if ready() {
        image::build("no_panic", &["no-panic"]).unwrap();
    }
}

#[test]
fn the_application_links_without_a_panic() {
    if ready() {
        image::build("monitor", &["no-panic"]).unwrap();
    }
}

#[test]
fn a_deliberate_panic_does_not_link() {
    if !ready() {
        return;
    }
    match image::build("no_panic", &["no-panic-control"]) {
        Err(ImageError::NotBuilt { said, .. }) => assert!(
            said.contains("undefined symbol") && said.contains(MISSING_SYMBOL),
            "it failed for another reason: {said}"
        ),
        other => panic!("an image with a panic must not link: {other:?}"),
    }
}
