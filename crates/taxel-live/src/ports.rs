//! Lists the serial ports of the system.

use serde::Serialize;
use serialport::SerialPortType;

use crate::{Error, Result};

/// A serial port.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Port {
    /// Name of the port, as "COM3" or "/dev/ttyACM0".
    pub place: String,
    /// "usb", "pci", "bluetooth" or "other".
    pub kind: &'static str,
    /// The product name of a USB device, if it reports it.
    pub product: Option<String>,
    /// The manufacturer of a USB device, if it reports it.
    pub maker: Option<String>,
    /// The serial number of a USB device, if it reports it.
    pub serial: Option<String>,
    /// Vendor and product numbers of a USB device.
    pub usb: Option<(u16, u16)>,
}

/// All serial ports, USB devices first, each kind by name. Pseudo-terminals are not included: the system does not list
/// them.
///
/// # Errors
///
/// `Socket` if the system cannot list its ports.
pub fn ports() -> Result<Vec<Port>> {
    let found = serialport::available_ports().map_err(|error| Error::socket("serial ports")(error.into()))?;
    let mut ports: Vec<Port> = found.into_iter().map(|port| described(port.port_name, port.port_type)).collect();
    ports.sort_by(|a, b| (a.kind != "usb", &a.place).cmp(&(b.kind != "usb", &b.place)));
    Ok(ports)
}

fn described(place: String, kind: SerialPortType) -> Port {
    let port = |kind| Port { place, kind, product: None, maker: None, serial: None, usb: None };
    match kind {
        SerialPortType::UsbPort(usb) => Port {
            product: usb.product,
            maker: usb.manufacturer,
            serial: usb.serial_number,
            usb: Some((usb.vid, usb.pid)),
            ..port("usb")
        },
        SerialPortType::PciPort => port("pci"),
        SerialPortType::BluetoothPort => port("bluetooth"),
        SerialPortType::Unknown => port("other"),
    }
}

#[cfg(test)]
mod tests {
    use serialport::UsbPortInfo;

    use super::*;

    #[test]
    fn a_usb_port_has_its_product_in_every_system() {
        for place in ["COM3", "/dev/ttyACM0"] {
            let [product, maker, serial] = ["Uno", "Arduino", "75"].map(|text| Some(text.to_owned()));
            let (manufacturer, serial_number) = (maker.clone(), serial.clone());
            let usb = UsbPortInfo { vid: 0x2341, pid: 0x43, serial_number, manufacturer, product: product.clone() };
            let port = described(place.to_owned(), SerialPortType::UsbPort(usb));
            let (place, usb) = (place.to_owned(), Some((0x2341, 0x43)));
            assert_eq!(port, Port { place, kind: "usb", product, maker, serial, usb });
        }
        assert_eq!(described("COM1".to_owned(), SerialPortType::Unknown).kind, "other");
    }
}
