//! The report in a browser: every picture is drawn, nothing is complained of, nothing is asked for, and it can
//! be read with mouse, fingers and keys, on a screen, a phone and paper. Pictures stay in out/ci/report.

mod browser;
mod made_up_run;

use std::path::{Path, PathBuf};

use browser::Browser;
use made_up_run::{Run, made_up};
use serde_json::Value;
use surefix_host_tests::report;

const PANELS: [&str; 15] = [
    "Integrity by state and reason",
    "Track, local grid",
    "Sky plot",
    "Height above the ellipsoid",
    "Horizontal level and error",
    "Vertical level and error",
    "Residuals by satellite",
    "C/N0 by satellite",
    "Bank: statistic over threshold, horizontal",
    "Bank: statistic over threshold, vertical",
    "Test statistic of the snapshot",
    "Satellites",
    "Satellites used and excluded",
    "Horizontal: level against error",
    "Vertical: level against error",
];

/// For each picture: its name and how many of its pixels have a hue, which axes and grids have not.
const COLOURED: &str = "[...document.querySelectorAll('figure')].map((figure) => {
  const canvas = figure.querySelector('canvas');
  const { data } = canvas.getContext('2d').getImageData(0, 0, canvas.width, canvas.height);
  let n = 0;
  for (let k = 0; k < data.length; k += 4)
    if (data[k + 3] > 99 && Math.max(data[k], data[k + 1], data[k + 2]) - Math.min(data[k], data[k + 1], data[k + 2]) > 48) n++;
  return [figure.dataset.panel, n];
})";

fn browser(profile: &str) -> Option<Browser> {
    let program = browser::find();
    if program.is_none() {
        eprintln!(
            "SKIPPED: the report in a browser: there is no Chromium; `cargo xtask setup` installs it"
        );
    }
    program.map(|program| Browser::start(&program, profile))
}

fn page(name: &str, epochs: usize) -> PathBuf {
    let run = Run {
        epochs,
        truth: true,
        used: true,
        bank: true,
        satellites: true,
    };
    report::write(&made_up(name, &run)).unwrap()
}

fn pictures() -> PathBuf {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../out/ci/report");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

/// What is wrong with a page just opened.
fn faults(browser: &mut Browser) -> Vec<String> {
    let mut faults = browser.complaints.clone();
    if browser.requests.len() != 1 {
        faults.push(format!("requests: {:?}", browser.requests));
    }
    let coloured = browser.evaluate(COLOURED);
    let coloured: Vec<(&str, u64)> = coloured
        .as_array()
        .unwrap()
        .iter()
        .map(|pair| (pair[0].as_str().unwrap(), pair[1].as_u64().unwrap()))
        .collect();
    for panel in PANELS {
        match coloured.iter().find(|(name, _)| *name == panel) {
            None => faults.push(format!("no picture `{panel}`")),
            Some((_, n)) if *n < 100 => faults.push(format!("`{panel}` has {n} coloured pixels")),
            Some(_) => {}
        }
    }
    if coloured.len() != PANELS.len() {
        faults.push(format!("pictures: {coloured:?}"));
    }
    let wider = browser.evaluate("(({ scrollWidth, clientWidth }) => Math.max(0, scrollWidth - clientWidth))(document.documentElement)");
    if wider.as_i64() != Some(0) {
        faults.push(format!("the page is {wider} pixels wider than the window"));
    }
    faults
}

#[test]
fn every_picture_is_drawn_without_a_complaint_or_a_request() {
    let Some(mut browser) = browser("browser-pictures") else {
        return;
    };
    let page = page("report-browser", 900);
    let folder = pictures();
    for (name, size, phone, dark) in [
        ("wide", [1600, 1000], false, false),
        ("wide-dark", [1600, 1000], false, true),
        ("phone", [390, 844], true, false),
        ("phone-dark", [390, 844], true, true),
    ] {
        browser.look(size, phone, dark);
        browser.open(&page);
        assert_eq!(faults(&mut browser), Vec::<String>::new(), "{name}");
        let file = folder.join(format!("{name}.png"));
        browser.screenshot(&file);
        assert!(std::fs::metadata(&file).unwrap().len() > 50_000, "{name}");
        // Dark is the page's, too.
        let paper = browser.evaluate("getComputedStyle(document.body).backgroundColor");
        assert_eq!(paper == "rgb(255, 255, 255)", !dark, "{paper}");
    }
    browser.look([1600, 1000], false, true);
    browser.open(&page);
    browser.print(&folder.join("print.pdf"));
    assert_eq!(browser.complaints, Vec::<String>::new());
    // All of it: a page counts less when pictures change their size while it is laid out.
    let pdf = std::fs::read(folder.join("print.pdf")).unwrap();
    let pages = pdf.windows(12).filter(|w| w == b"/Type /Page\n").count();
    assert!((5..=8).contains(&pages), "{pages} pages");
    // Light whatever the screen is, and as before when it is printed.
    let before = pixels(&mut browser, "Sky plot");
    browser.evaluate("window.dispatchEvent(new Event('beforeprint'))");
    browser.settle();
    assert_eq!(faults(&mut browser), Vec::<String>::new(), "print");
    let paper = browser.evaluate("getComputedStyle(document.body).backgroundColor");
    assert_eq!(paper, "rgb(255, 255, 255)");
    browser.evaluate("window.dispatchEvent(new Event('afterprint'))");
    browser.settle();
    assert_eq!(pixels(&mut browser, "Sky plot"), before);
}

#[test]
fn a_page_that_throws_asks_or_draws_nothing_is_found_out() {
    let Some(mut browser) = browser("browser-faults") else {
        return;
    };
    let sound = std::fs::read_to_string(page("report-browser-faults", 900)).unwrap();
    let broken =
        PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("report-browser-faults/broken.html");
    for (from, to, fault) in [
        // A picture throws: those after it stay empty.
        (
            "function systemKeys(caption) {",
            "function systemKeys(caption) { none();",
            "none",
        ),
        // A picture draws nothing.
        (
            "const place = (s, k) => {",
            "const place = (s, k) => { return [NaN, NaN];",
            "Sky plot",
        ),
        // The page asks for another file.
        (
            "<main",
            "<img src=\"http://127.0.0.1:9/a.png\"><main",
            "127.0.0.1",
        ),
    ] {
        assert_eq!(sound.matches(from).count(), 1, "{from}");
        std::fs::write(&broken, sound.replace(from, to)).unwrap();
        browser.look([1600, 1000], false, false);
        browser.open(&broken);
        let faults = faults(&mut browser);
        assert!(
            faults.iter().any(|text| text.contains(fault)),
            "{fault}: {faults:?}"
        );
    }
}

/// Middle of a picture, once it is in the window.
fn middle(browser: &mut Browser, panel: &str) -> [f64; 2] {
    let place = browser.evaluate(&format!(
        "(() => {{ const canvas = document.querySelector('figure[data-panel=\"{panel}\"] canvas');
          canvas.scrollIntoView({{ block: 'center' }});
          const box = canvas.getBoundingClientRect();
          return [box.x + box.width / 2, box.y + box.height / 2]; }})()"
    ));
    browser.settle();
    [place[0].as_f64().unwrap(), place[1].as_f64().unwrap()]
}

fn text(browser: &mut Browser, selector: &str) -> String {
    let text = browser.evaluate(&format!("document.querySelector('{selector}').textContent"));
    text.as_str().unwrap().to_owned()
}

fn whole_run_is_shown(browser: &mut Browser) -> bool {
    browser.evaluate("document.getElementById('reset').disabled") == Value::Bool(true)
}

fn pixels(browser: &mut Browser, panel: &str) -> Value {
    browser.evaluate(&format!(
        "document.querySelector('figure[data-panel=\"{panel}\"] canvas').toDataURL()"
    ))
}

#[test]
fn the_run_can_be_read_with_mouse_fingers_and_keys() {
    let Some(mut browser) = browser("browser-moving") else {
        return;
    };
    let page = page("report-browser-moving", 900);
    browser.look([1200, 900], false, false);
    browser.open(&page);
    // One cursor for all pictures.
    let at = middle(&mut browser, "Height above the ellipsoid");
    let before = pixels(&mut browser, "Residuals by satellite");
    browser.mouse(at, None);
    assert!(
        text(&mut browser, "#cursor").starts_with("00:07:"),
        "{}",
        text(&mut browser, "#cursor")
    );
    assert!(
        text(
            &mut browser,
            "figure[data-panel=\"Horizontal level and error\"]"
        )
        .contains("HPL")
    );
    assert_ne!(pixels(&mut browser, "Residuals by satellite"), before);
    // One time axis for all.
    let before = pixels(&mut browser, "Sky plot");
    assert!(whole_run_is_shown(&mut browser));
    browser.mouse(at, Some(-120.0));
    assert!(!whole_run_is_shown(&mut browser));
    assert_ne!(pixels(&mut browser, "Sky plot"), before);
    browser.evaluate("document.getElementById('reset').click()");
    browser.settle();
    assert!(whole_run_is_shown(&mut browser));
    browser.drag([at[0] - 100.0, at[1]], at);
    assert!(!whole_run_is_shown(&mut browser));
    // Keys.
    browser.evaluate("document.querySelector('figure[data-panel=\"Satellites\"] canvas').focus()");
    browser.key("Home");
    assert!(whole_run_is_shown(&mut browser));
    browser.mouse(at, None);
    let before = text(&mut browser, "#cursor");
    browser.key("ArrowRight");
    assert_ne!(text(&mut browser, "#cursor"), before);
    browser.key("+");
    assert!(!whole_run_is_shown(&mut browser));
    browser.key("Home");
    // The track has a scale of its own, and its positions move the cursor.
    let at = middle(&mut browser, "Track, local grid");
    let before = pixels(&mut browser, "Track, local grid");
    browser.mouse(at, Some(-120.0));
    let zoomed = pixels(&mut browser, "Track, local grid");
    assert_ne!(zoomed, before);
    browser.drag(at, [at[0] + 60.0, at[1] + 20.0]);
    assert_ne!(pixels(&mut browser, "Track, local grid"), zoomed);
    assert!(whole_run_is_shown(&mut browser));
    // Two fingers.
    browser.look([390, 844], true, false);
    browser.open(&page);
    let [x, y] = middle(&mut browser, "Height above the ellipsoid");
    browser.pinch(
        [[x - 20.0, y], [x + 20.0, y]],
        [[x - 80.0, y], [x + 80.0, y]],
    );
    assert!(!whole_run_is_shown(&mut browser));
    assert_eq!(browser.complaints, Vec::<String>::new());
}

#[test]
fn a_day_at_one_hertz_opens_and_every_picture_of_it_is_drawn() {
    let Some(mut browser) = browser("browser-day") else {
        return;
    };
    browser.look([1600, 1000], false, false);
    browser.open(&page("report-browser-day", 86_400));
    assert_eq!(faults(&mut browser), Vec::<String>::new());
    browser.screenshot(&pictures().join("day.png"));
}
