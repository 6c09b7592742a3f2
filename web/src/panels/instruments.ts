import type { PanelFactory } from "../panel";

export const instruments: PanelFactory = () => ({ element: document.createElement("div") });
