//! Line charts as SVG: small panels on one page, readable in any browser.

use std::fmt::Write as _;

/// A line of a chart; points that are not finite interrupt it.
#[derive(Clone, Debug)]
pub struct Curve {
    /// For the legend; a curve without a name is not in it.
    pub name: String,
    /// x and y.
    pub points: Vec<(f64, f64)>,
    /// CSS colour.
    pub colour: &'static str,
    /// Dashed instead of solid.
    pub dashed: bool,
}

/// A chart; one without a point is its legend alone.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Above it.
    pub title: String,
    /// Below it.
    pub x_label: String,
    /// Beside it.
    pub y_label: String,
    /// Its lines.
    pub curves: Vec<Curve>,
    /// Vertical lines with what they are.
    pub marks: Vec<(f64, String)>,
    /// Decades instead of a linear scale, on x and on y.
    pub decades: [bool; 2],
}

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 290.0;
/// Left, right, top, bottom of the plot within its panel.
const MARGIN: [f64; 4] = [58.0, 14.0, 30.0, 42.0];
const LEGEND_STEP: f64 = 15.0;

/// A scale from numbers to pixels.
struct Scale {
    low: f64,
    high: f64,
    decades: bool,
    from: f64,
    to: f64,
}

impl Scale {
    fn new(values: impl Iterator<Item = f64>, decades: bool, from: f64, to: f64) -> Self {
        let finite = values.filter(|v| v.is_finite() && (!decades || *v > 0.0));
        let (mut low, mut high) = finite.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| {
            (a.min(v), b.max(v))
        });
        if low > high {
            (low, high) = if decades { (0.1, 1.0) } else { (0.0, 1.0) };
        }
        if decades {
            low = libm::pow(10.0, libm::floor(libm::log10(low)));
            high = libm::pow(10.0, libm::ceil(libm::log10(high)));
            if high <= low {
                high = 10.0 * low;
            }
        } else {
            low = low.min(0.0);
            if high <= low {
                high = low + 1.0;
            }
        }
        Self {
            low,
            high,
            decades,
            from,
            to,
        }
    }

    fn at(&self, value: f64) -> f64 {
        let part = if self.decades {
            libm::log10(value / self.low) / libm::log10(self.high / self.low)
        } else {
            (value - self.low) / (self.high - self.low)
        };
        self.from + part * (self.to - self.from)
    }

    /// Where to put numbers: decades, or steps of 1, 2 or 5.
    fn ticks(&self) -> Vec<f64> {
        if self.decades {
            let mut tick = self.low;
            let mut ticks = Vec::new();
            while tick <= self.high * 1.001 {
                ticks.push(tick);
                tick *= 10.0;
            }
            return ticks;
        }
        let raw = (self.high - self.low) / 6.0;
        let decade = libm::pow(10.0, libm::floor(libm::log10(raw)));
        let step = [1.0, 2.0, 5.0, 10.0]
            .into_iter()
            .map(|m| m * decade)
            .find(|step| *step >= raw)
            .unwrap_or(raw);
        let first = libm::ceil(self.low / step);
        (0..20)
            .map(|k| (first + f64::from(k)) * step)
            .take_while(|tick| *tick <= self.high * (1.0 + 1e-9))
            .collect()
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
}

/// Four significant digits, without trailing zeros.
fn label(value: f64) -> String {
    if value == 0.0 {
        return "0".into();
    }
    if value.abs() < 1e-3 || value.abs() >= 1e6 {
        return format!("{value:e}");
    }
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn draw(panel: &Panel, left: f64, top: f64, svg: &mut String) {
    let [ml, mr, mt, mb] = MARGIN;
    let points = || panel.curves.iter().flat_map(|curve| &curve.points);
    let [decades_x, decades_y] = panel.decades;
    let x = Scale::new(
        points().map(|p| p.0),
        decades_x,
        left + ml,
        left + WIDTH - mr,
    );
    let y = Scale::new(
        points().map(|p| p.1),
        decades_y,
        top + HEIGHT - mb,
        top + mt,
    );
    let _ = write!(
        svg,
        "<text class=\"title\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n\
         <text class=\"axis\" text-anchor=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{}</text>\n\
         <text class=\"axis\" text-anchor=\"middle\" transform=\"translate({:.1} {:.1}) rotate(-90)\">{}</text>\n",
        left + ml,
        top + 18.0,
        escaped(&panel.title),
        0.5 * (x.from + x.to),
        top + HEIGHT - 8.0,
        escaped(&panel.x_label),
        left + 14.0,
        0.5 * (y.from + y.to),
        escaped(&panel.y_label),
    );
    if points().next().is_none() {
        legend(panel, left + ml, top, svg);
        return;
    }
    for tick in x.ticks() {
        let at = x.at(tick);
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{at:.1} {:.1}V{:.1}\"/><text class=\"tick\" text-anchor=\"middle\" x=\"{at:.1}\" y=\"{:.1}\">{}</text>",
            y.from,
            y.to,
            y.from + 13.0,
            label(tick)
        );
    }
    for tick in y.ticks() {
        let at = y.at(tick);
        let _ = writeln!(
            svg,
            "<path class=\"grid\" d=\"M{:.1} {at:.1}H{:.1}\"/><text class=\"tick\" text-anchor=\"end\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            x.from,
            x.to,
            x.from - 5.0,
            at + 3.5,
            label(tick)
        );
    }
    for (value, name) in &panel.marks {
        let at = x.at(*value);
        let _ = writeln!(
            svg,
            "<path class=\"mark\" d=\"M{at:.1} {:.1}V{:.1}\"/><text class=\"tick\" text-anchor=\"middle\" transform=\"translate({:.1} {:.1}) rotate(-90)\">{}</text>",
            y.from,
            y.to,
            at - 3.0,
            0.5 * (y.from + y.to),
            escaped(name)
        );
    }
    for curve in &panel.curves {
        let mut path = String::new();
        let mut pen = 'M';
        for (px, py) in &curve.points {
            let (px, py) = (x.at(*px), y.at(*py));
            if px.is_finite() && py.is_finite() {
                let _ = write!(path, "{pen}{px:.1} {py:.1}");
                pen = 'L';
            } else {
                pen = 'M';
            }
        }
        let (colour, dash) = (curve.colour, dash(curve));
        let _ = writeln!(
            svg,
            "<path class=\"curve\" stroke=\"{colour}\"{dash} d=\"{path}\"/>"
        );
    }
    legend(panel, x.from, top, svg);
}

const fn dash(curve: &Curve) -> &'static str {
    if curve.dashed {
        " stroke-dasharray=\"5 3\""
    } else {
        ""
    }
}

/// The lines with their names, below each other.
fn legend(panel: &Panel, left: f64, top: f64, svg: &mut String) {
    let named = panel.curves.iter().filter(|curve| !curve.name.is_empty());
    for (number, curve) in named.enumerate() {
        let (colour, dash) = (curve.colour, dash(curve));
        let y = top + MARGIN[2] + 10.0 + LEGEND_STEP * number as f64;
        let _ = writeln!(
            svg,
            "<path class=\"curve\" stroke=\"{colour}\"{dash} d=\"M{:.1} {y:.1}h18\"/>\
             <text class=\"tick\" x=\"{:.1}\" y=\"{:.1}\">{}</text>",
            left + 6.0,
            left + 28.0,
            y + 3.5,
            escaped(&curve.name)
        );
    }
}

/// A page of panels in rows of so many.
pub fn page(title: &str, panels: &[Panel], columns: usize) -> String {
    let rows = panels.len().div_ceil(columns.max(1));
    let (width, height) = (WIDTH * columns as f64, 30.0 + HEIGHT * rows as f64);
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\">\n\
         <style>text{{font-family:sans-serif;fill:#222}}.head{{font-size:15px;font-weight:bold}}.title{{font-size:12.5px;font-weight:bold}}.axis{{font-size:11px}}.tick{{font-size:10px}}\
         .grid{{stroke:#e2e2e2;fill:none}}.mark{{stroke:#888;stroke-dasharray:2 3;fill:none}}.curve{{fill:none;stroke-width:1.6}}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n\
         <text class=\"head\" x=\"12\" y=\"20\">{}</text>\n",
        escaped(title)
    );
    for (number, panel) in panels.iter().enumerate() {
        let (row, column) = (number / columns, number % columns);
        draw(
            panel,
            WIDTH * column as f64,
            30.0 + HEIGHT * row as f64,
            &mut svg,
        );
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panel(points: Vec<(f64, f64)>, decades: [bool; 2]) -> Panel {
        Panel {
            title: "a < b".into(),
            curves: vec![Curve {
                name: "c".into(),
                points,
                colour: "red",
                dashed: false,
            }],
            decades,
            ..Panel::default()
        }
    }

    #[test]
    fn a_gap_in_the_numbers_is_a_gap_in_the_line() {
        let points = vec![(0.0, 1.0), (1.0, f64::NAN), (2.0, 3.0), (3.0, 4.0)];
        let svg = page("t", &[panel(points, [false; 2])], 2);
        let curve = svg.split("class=\"curve\"").nth(1).unwrap();
        let path = curve.split("d=\"").nth(1).unwrap().split('"').next();
        assert_eq!(path.unwrap().matches('M').count(), 2);
        assert!(svg.contains("a &lt; b") && !svg.contains("NaN"));
    }

    #[test]
    fn ticks_are_round_numbers_within_the_scale() {
        let linear = Scale::new([0.0, 37.0].into_iter(), false, 0.0, 100.0);
        assert_eq!(linear.ticks(), [0.0, 10.0, 20.0, 30.0]);
        assert_eq!(linear.at(18.5), 50.0);
        let decades = Scale::new([0.3, 40.0].into_iter(), true, 0.0, 300.0);
        assert_eq!(decades.ticks().len(), 4);
        assert!((decades.at(1.0) - 100.0).abs() < 1e-9);
        let legend = page("t", &[panel(Vec::new(), [true; 2])], 1);
        assert!(!legend.contains("NaN") && !legend.contains("class=\"grid\""));
        assert_eq!(legend.matches("class=\"curve\"").count(), 1);
    }
}
