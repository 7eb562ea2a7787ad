//! Plots of points over logarithmic or linear axes, as SVG.

use super::MeasureError;
use plotters::{
    coord::{
        Shift,
        ranged1d::{AsRangedCoord, ValueFormatter},
    },
    prelude::{
        ChartBuilder, Circle, Color, DrawingArea, IntoDrawingArea, IntoLogRange, LineSeries, Palette, Palette99,
        PathElement, RGBAColor, RGBColor, SVGBackend, Text, WHITE,
    },
};

/// Points joined in their order.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// In the legend.
    pub name: String,
    /// Those with a coordinate that is not positive and finite are left out.
    pub points: Vec<[f64; 2]>,
}

/// Least width of the legend in pixels.
const LEGEND: u32 = 150;

/// How places on axes belong to numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Both axes from zero.
    Linear,
    /// Both axes in whole decades.
    Logarithmic,
}

/// A plot.
#[derive(Clone, Debug, PartialEq)]
pub struct Plot {
    /// Above the plot.
    pub title: String,
    /// Names of the axes, with units.
    pub axes: [String; 2],
    /// Of both axes.
    pub scale: Scale,
    /// The curves.
    pub series: Vec<Series>,
    /// Size in pixels.
    pub size: [u32; 2],
}

impl Plot {
    /// The plot as an SVG document.
    ///
    /// # Errors
    /// [`MeasureError::Plot`] if there is nothing to draw.
    pub fn svg(&self) -> Result<String, MeasureError> {
        let mut text = String::new();
        self.draw(&mut text).map_err(|why| MeasureError::Plot(self.title.clone(), why))?;
        Ok(text)
    }

    /// Width of the legend in pixels, by its longest name.
    fn legend(&self) -> u32 {
        let longest = self.series.iter().map(|series| series.name.chars().count()).max().unwrap_or(0);
        LEGEND.max(40 + 7 * longest as u32)
    }

    fn draw(&self, text: &mut String) -> Result<(), String> {
        let points = || self.series.iter().flat_map(|s| s.points.iter()).filter(usable);
        let high = [0, 1].map(|axis| points().map(|p| p[axis]).fold(0.0, f64::max));
        if points().next().is_none() {
            return Err(String::from("there are no points to draw"));
        }
        let area = SVGBackend::with_string(text, (self.size[0], self.size[1])).into_drawing_area();
        area.fill(&WHITE).map_err(say)?;
        let (left, legend) = area.split_horizontally(self.size[0].saturating_sub(self.legend()));
        let number = |x: &f64| format!("{}", (x * 1e4).round() / 1e4);
        match self.scale {
            Scale::Linear => {
                let range = |axis: usize| 0.0..1.05 * high[axis];
                self.draw_curves(&left, range(0), range(1), &number)?;
            }
            Scale::Logarithmic => {
                let range = |axis: usize| {
                    let low = points().map(|p| p[axis]).fold(f64::INFINITY, f64::min);
                    // Whole decades, so that the grid says where one is.
                    let end = 10_f64.powf((high[axis].log10() + 1e-9).ceil());
                    (10_f64.powf(low.log10().floor())..end.max(low * 10.0)).log_scale()
                };
                self.draw_curves(&left, range(0), range(1), &power)?;
            }
        }
        // The legend stands beside the plot, where it hides nothing.
        for (index, series) in self.series.iter().enumerate() {
            let y = 48 + 20 * index as i32;
            let line = PathElement::new([(4, y), (22, y)], color(index).stroke_width(2));
            legend.draw(&line).map_err(say)?;
            let name = Text::new(series.name.clone(), (28, y - 7), ("sans-serif", 13));
            legend.draw(&name).map_err(say)?;
        }
        area.present().map_err(say)
    }

    fn draw_curves<X, Y>(&self, area: &Area<'_>, x: X, y: Y, label: &dyn Fn(&f64) -> String) -> Result<(), String>
    where
        X: AsRangedCoord<Value = f64>,
        Y: AsRangedCoord<Value = f64>,
        X::CoordDescType: ValueFormatter<f64>,
        Y::CoordDescType: ValueFormatter<f64>,
    {
        let mut chart = ChartBuilder::on(area)
            .caption(&self.title, ("sans-serif", 18))
            .margin(12)
            .x_label_area_size(42)
            .y_label_area_size(70)
            .build_cartesian_2d(x, y)
            .map_err(say)?;
        chart
            .configure_mesh()
            .x_desc(&self.axes[0])
            .y_desc(&self.axes[1])
            .x_label_formatter(&label)
            .y_label_formatter(&label)
            .bold_line_style(RGBColor(205, 205, 205))
            .light_line_style(WHITE)
            .label_style(("sans-serif", 13))
            .draw()
            .map_err(say)?;
        for (index, series) in self.series.iter().enumerate() {
            let color = color(index);
            let line: Vec<(f64, f64)> = series.points.iter().filter(usable).map(|p| (p[0], p[1])).collect();
            chart.draw_series(LineSeries::new(line.iter().copied(), color.stroke_width(2))).map_err(say)?;
            chart.draw_series(line.iter().map(|p| Circle::new(*p, 3, color.filled()))).map_err(say)?;
        }
        Ok(())
    }
}

/// Where curves are drawn.
type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn usable(point: &&[f64; 2]) -> bool {
    point.iter().all(|x| x.is_finite() && *x > 0.0)
}

fn color(index: usize) -> RGBAColor {
    Palette99::pick(index % Palette99::COLORS.len()).to_rgba()
}

fn say(error: impl std::fmt::Display) -> String {
    error.to_string()
}

/// A power of ten as such.
fn power(x: &f64) -> String {
    let exponent = x.log10();
    if (-2.0..4.0).contains(&exponent) { format!("{}", (x * 1e4).round() / 1e4) } else { format!("1e{exponent:.0}") }
}
